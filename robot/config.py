"""The robot's settings: frozen dataclasses of every stage, read from one TOML file and checked.

An unknown key, a value of the wrong type or outside the range declared beside its default, or two ports that
were swapped are refused in one line that names file, line, key, value and rule. Nothing is repaired silently.
"""

import dataclasses
import re
import tomllib
import typing
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, AllowInfNan, BaseModel, ConfigDict, Strict, ValidationError, create_model
from pydantic_core import PydanticCustomError

from lemtomap.errors import BadSetting
from lemtomap.grid.config import SlamConfig
from lemtomap.nav.config import NavConfig
from lemtomap.odometry import OdometryConfig
from lemtomap.robot.devices.ports import (
    HOKUYO,
    KOBUKI,
    ListPorts,
    describe,
    matches_identity,
)
from lemtomap.robot.motion.safety import SafetyLimits
from lemtomap.robot.motion.velocity import SmootherConfig
from lemtomap.settings import Range, range_of, within
from lemtomap.topo.config import TopoConfig

Key = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class PortsConfig:
    """Serial ports; an empty path means: find it by its USB identity."""

    kobuki: str = ""
    hokuyo: str = ""


@dataclass(frozen=True, slots=True)
class LaserConfig:
    """Where the laser sits on the base."""

    x_m: float = within(0.0, -0.3, 0.3, "it stands on the base")
    y_m: float = within(0.0, -0.3, 0.3, "it stands on the base")
    yaw_rad: float = within(0.0, -3.15, 3.15)


@dataclass(frozen=True, slots=True)
class RobotConfig:
    """All a run can be told."""

    ports: PortsConfig = field(default_factory=PortsConfig)
    laser: LaserConfig = field(default_factory=LaserConfig)
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    slam: SlamConfig = field(default_factory=SlamConfig)
    topo: TopoConfig = field(default_factory=TopoConfig)
    nav: NavConfig = field(default_factory=NavConfig)
    safety: SafetyLimits = field(default_factory=SafetyLimits)
    smoother: SmootherConfig = field(default_factory=SmootherConfig)


def load(path: Path, ports: ListPorts | None = None) -> RobotConfig:
    """Read and check a TOML file. Raises BadSetting.

    `ports` lists the machine's serial ports, to notice a swapped pair; None: not checked.
    """
    try:
        text = path.read_text(encoding="utf-8")
        data = tomllib.loads(text)
    except FileNotFoundError:
        raise BadSetting(f"{path}: no such file") from None
    except RecursionError:
        raise BadSetting(f"{path}: nested too deep") from None
    except (OSError, ValueError) as error:  # not UTF-8, no TOML, a number of 5,000 digits
        raise BadSetting(f"{path}: {error}") from None
    lines = key_lines(text)
    try:
        config = from_mapping(data)
        _check_ports(config.ports, ports)
    except _BadKey as error:
        raise BadSetting(
            f"{path}:{_line_of(error.key, lines)}: {'.'.join(error.key)}: {error.reason}"
        ) from None
    return config


def from_mapping(data: Mapping[str, Any]) -> RobotConfig:
    """Build the settings from plain nested values. Raises BadSetting naming the key."""
    try:
        model = _model_of(RobotConfig).model_validate(dict(data))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = tuple(str(part) for part in first["loc"])
        reason = "unknown key" if first["type"] == "extra_forbidden" else _reason(first)
        raise _BadKey(key, reason) from None
    built: RobotConfig = _build(RobotConfig, model, ())
    return built


def to_mapping(config: Any) -> Any:
    """Return settings as plain nested values, for summary.json."""
    if dataclasses.is_dataclass(config):
        return {f.name: to_mapping(getattr(config, f.name)) for f in dataclasses.fields(config)}
    if isinstance(config, Enum):
        return config.value
    return list(config) if isinstance(config, tuple) else config


def key_lines(text: str) -> dict[Key, int]:
    """Return the line of each table and key of a TOML text, counted from 1."""
    lines: dict[Key, int] = {}
    table: Key = ()
    for number, line in enumerate(text.splitlines(), start=1):
        if header := re.match(r"\s*\[\s*([^\[\]]+?)\s*\]", line):
            table = _split(header.group(1))
            lines.setdefault(table, number)
        elif pair := re.match(r"\s*([A-Za-z0-9_\-.\"' ]+?)\s*=", line):
            lines.setdefault((*table, *_split(pair.group(1))), number)
    return lines


class _BadKey(BadSetting):
    """A key is wrong; `load` adds file and line."""

    def __init__(self, key: Key, reason: str) -> None:
        super().__init__(f"{'.'.join(key)}: {reason}")
        self.key, self.reason = key, reason


def _split(dotted: str) -> Key:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))


def _line_of(key: Key, lines: Mapping[Key, int]) -> int:
    """Return the line of a key, or of the nearest table around it."""
    for length in range(len(key), 0, -1):
        if key[:length] in lines:
            return lines[key[:length]]
    return 1


def _reason(error: Mapping[str, Any]) -> str:
    shown = repr(error["input"])
    text = str(error["msg"]).removeprefix("Input should be ").removeprefix("Input ")
    rule = text if error["type"] == "range" else f"must be {text}"
    return f"{shown if len(shown) < 60 else 'value'} {rule}"


@cache
def _model_of(cls: Any) -> type[BaseModel]:
    """Return a pydantic model with the dataclass' fields, unknown keys forbidden."""
    hints = typing.get_type_hints(cls)
    fields: dict[str, Any] = {}
    for f in dataclasses.fields(cls):
        made = f.default_factory is not dataclasses.MISSING
        default = f.default_factory() if f.default_factory is not dataclasses.MISSING else f.default
        fields[f.name] = (_model_of(hints[f.name]) if made else _checked(hints[f.name], f), default)
    model: type[BaseModel] = create_model(
        cls.__name__, __config__=ConfigDict(extra="forbid", arbitrary_types_allowed=True), **fields
    )
    return model


def _checked(hint: Any, declared: "dataclasses.Field[Any]") -> Any:
    """Return the field's type with its rules: a number is finite and in its range, and no truth value."""
    allowed = range_of(declared)
    if allowed is None:
        return hint
    counts = int in (hint, *typing.get_args(hint))
    check = AfterValidator(partial(_in_range, allowed))
    ranged: Any = (
        Annotated[int, Strict(), check] if counts else Annotated[float, AllowInfNan(False), Strict(), check]
    )
    return ranged | None if declared.default is None else ranged


def _in_range(allowed: Range, value: float) -> float:
    if value not in allowed:
        raise PydanticCustomError("range", "{rule}", {"rule": f"must lie {allowed}"})
    return value


def _build(cls: Any, model: BaseModel, key: Key) -> Any:
    """Build the frozen dataclass; what its own checks refuse gets the table's name."""
    values = {}
    for f in dataclasses.fields(cls):
        value = getattr(model, f.name)
        inner = (*key, f.name)
        hint = typing.get_type_hints(cls)[f.name]
        values[f.name] = _build(hint, value, inner) if isinstance(value, BaseModel) else value
    try:
        return cls(**values)
    except (BadSetting, ValueError) as error:
        raise _BadKey(key, str(error)) from None


def _check_ports(config: PortsConfig, ports: ListPorts | None) -> None:
    """Notice one port given twice, and ports whose USB identity is the other device's."""
    if config.kobuki and config.kobuki == config.hokuyo:
        raise _BadKey(("ports", "hokuyo"), f"{config.hokuyo} is given for both devices")
    if ports is None:
        return
    for key, path, wrong in (("kobuki", config.kobuki, HOKUYO), ("hokuyo", config.hokuyo, KOBUKI)):
        real = str(Path(path).resolve()) if path else ""
        for port in ports():
            if port.device == real and matches_identity(port, wrong):
                raise _BadKey(
                    ("ports", key), f"{describe(port)} is a {wrong.name}; are the two ports swapped?"
                )
