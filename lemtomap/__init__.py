"""LEMTOMap: scans and odometry in, a rolling window under a relative topological map, a velocity out.

    with lemtomap.Mapper.open("my.lemto") as mapper:
        mapper.update(lemtomap.Scan(...), lemtomap.Odometry(...))

What stands here is what programs use; it is loaded when first asked for, so that `import lemtomap` costs
nothing. The mapping core knows no clock, thread, task, socket or serial port: time and random generators are
arguments. `lemtomap.drivers`, `lemtomap.robot` and `lemtomap.sim` make a robot of it.
"""

from importlib import import_module
from typing import Any

_HOMES = {
    "BadInput": "lemtomap.errors",
    "BadLog": "lemtomap.errors",
    "BadMap": "lemtomap.errors",
    "BadSample": "lemtomap.errors",
    "BadSetting": "lemtomap.errors",
    "Goal": "lemtomap.nav.types",
    "LemtomapError": "lemtomap.errors",
    "MapView": "lemtomap.types",
    "Mapper": "lemtomap.pipeline",
    "Navigator": "lemtomap.nav.navigator",
    "NoRoute": "lemtomap.errors",
    "NotStarted": "lemtomap.errors",
    "Odometry": "lemtomap.types",
    "Scan": "lemtomap.types",
    "Twist": "lemtomap.types",
}

__all__ = ["__version__", *sorted(_HOMES)]  # noqa: PLE0604 - all of them are text


def __getattr__(name: str) -> Any:
    if name == "__version__":
        value: Any = import_module("importlib.metadata").version("lemtomap")
    elif name in _HOMES:
        value = getattr(import_module(_HOMES[name]), name)
    else:
        raise AttributeError(f"module 'lemtomap' has no attribute '{name}'")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
