"""The robot's settings: frozen dataclasses of every stage, read from one TOML file and checked.

An unknown key, a value of the wrong type or outside the range declared beside its default, or two ports that
were swapped are refused in one line that names file, line, key, value and rule. Nothing is repaired silently.
"""

import dataclasses
import difflib
import math
import re
import tomllib
import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cache, partial, reduce
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, AllowInfNan, BaseModel, ConfigDict, Strict, ValidationError, create_model
from pydantic_core import PydanticCustomError

from lemtomap.areas.config import AreaConfig
from lemtomap.errors import BadSetting
from lemtomap.grid.config import SlamConfig
from lemtomap.nav.config import ExploreConfig, NavConfig
from lemtomap.nav.motion.collision import SKIN_M
from lemtomap.odometry import OdometryConfig
from lemtomap.robot.devices.ports import (
    HOKUYO,
    KOBUKI,
    ListPorts,
    describe,
    matches_identity,
)
from lemtomap.robot.motion.docking import DockingConfig
from lemtomap.robot.motion.retreat import ReflexConfig
from lemtomap.robot.motion.safety import SafetyLimits
from lemtomap.robot.motion.velocity import SmootherConfig
from lemtomap.settings import Range, range_of, within
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.loops.config import LoopConfig

Key = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class PortsConfig:
    """Serial ports; an empty path means: find it by its USB identity."""

    kobuki: str = ""
    hokuyo: str = ""


@dataclass(frozen=True, slots=True)
class LaserConfig:
    """Where the laser sits on the base."""

    x_m: float = within(0.0, -0.4, 0.4, "it stands on the base")
    y_m: float = within(0.0, -0.4, 0.4, "it stands on the base")
    yaw_rad: float = within(0.0, -3.15, 3.15)
    roll_deg: float = within(0.0, -180.0, 180.0)
    """180: it hangs upside down; nothing between, for it must see level."""

    def __post_init__(self) -> None:
        if abs(self.roll_deg) not in {0.0, 180.0}:
            raise BadSetting(f"roll_deg = {self.roll_deg:g}: must be 0 or 180, a laser looks level")

    @property
    def is_upside_down(self) -> bool:
        """Whether its beams turn the other way round."""
        return self.roll_deg != 0.0


@dataclass(frozen=True, slots=True)
class BodyConfig:
    """The robot's body, said once: for planning, exploring, safety gate, near-neighbour edges and viewer."""

    radius_m: float = within(0.18, 0.178, 0.4, "a Kobuki is 0.178 m round, and half a door is 0.4 m")
    """Of the circle round all of it, whatever stands on the base."""


SAID_ONCE: dict[Key, Key] = {
    ("nav", "body", "radius_m"): ("body", "radius_m"),
    ("topo", "robot_radius_m"): ("body", "radius_m"),
    ("safety", "body_radius_m"): ("body", "radius_m"),
    ("nav", "explore"): ("explore",),
}
"""Settings of the stages that follow from one of the robot's, and which."""


@dataclass(frozen=True, slots=True)
class RobotConfig:
    """All a run can be told. What several stages need is said once, and reaches each of them from there.

    Raises BadSetting when two settings do not go together.
    """

    body: BodyConfig = field(default_factory=BodyConfig)
    ports: PortsConfig = field(default_factory=PortsConfig)
    laser: LaserConfig = field(default_factory=LaserConfig)
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    slam: SlamConfig = field(default_factory=SlamConfig)
    topo: TopoConfig = field(default_factory=TopoConfig)
    nav: NavConfig = field(default_factory=NavConfig)
    safety: SafetyLimits = field(default_factory=SafetyLimits)
    smoother: SmootherConfig = field(default_factory=SmootherConfig)
    explore: ExploreConfig = field(default_factory=ExploreConfig)
    loops: LoopConfig = field(default_factory=LoopConfig)
    areas: AreaConfig = field(default_factory=AreaConfig)
    docking: DockingConfig = field(default_factory=DockingConfig)
    retreat: ReflexConfig = field(default_factory=ReflexConfig)

    def __post_init__(self) -> None:
        for stage, source in SAID_ONCE.items():
            top = _with(getattr(self, stage[0]), stage[1:], _at(self, source))
            object.__setattr__(self, stage[0], top)
        _check_relations(self)


def _at(config: Any, key: Key) -> Any:
    return reduce(getattr, key, config)


def _with(config: Any, key: Key, value: Any) -> Any:
    """Return frozen settings with one of them, however deep, replaced."""
    name, *rest = key
    inner = _with(getattr(config, name), tuple(rest), value) if rest else value
    return dataclasses.replace(config, **{name: inner})


def _check_relations(config: RobotConfig) -> None:
    """Refuse settings that do not go together, each by the key to change."""
    radius_m, laser = config.body.radius_m, config.laser
    away_m = math.hypot(laser.x_m, laser.y_m)
    if away_m > radius_m:
        raise _BadKey(
            ("laser", "x_m"), f"{away_m:g} m from the middle is outside the body (radius {radius_m:g})"
        )
    if config.safety.side_margin_m >= SKIN_M:
        rule = f"must be below the {SKIN_M:g} m that navigation keeps, or the gate holds what it steers past"
        raise _BadKey(("safety", "side_margin_m"), f"{config.safety.side_margin_m:g} {rule}")
    if config.safety.own_parts_m >= radius_m:
        raise _BadKey(("safety", "own_parts_m"), f"{config.safety.own_parts_m:g} must be below body.radius_m")


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
        reason = _unknown(key) if first["type"] == "extra_forbidden" else _reason(first)
        raise _BadKey(key, reason) from None
    built: RobotConfig = _build(RobotConfig, model, ())
    return built


def to_mapping(config: Any) -> Any:
    """Return settings as plain nested values, for summary.json."""
    if isinstance(config, RobotConfig):
        return {
            f.name: _stage_mapping(getattr(config, f.name), (f.name,)) for f in dataclasses.fields(config)
        }
    if dataclasses.is_dataclass(config):
        return {f.name: to_mapping(getattr(config, f.name)) for f in dataclasses.fields(config)}
    if isinstance(config, Enum):
        return config.value
    return list(config) if isinstance(config, tuple) else config


def _stage_mapping(config: Any, key: Key) -> Any:
    """Return a stage's settings without those that are said elsewhere."""
    if not dataclasses.is_dataclass(config):
        return to_mapping(config)
    names = [f.name for f in dataclasses.fields(config) if (*key, f.name) not in SAID_ONCE]
    return {name: _stage_mapping(getattr(config, name), (*key, name)) for name in names}


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


def _unknown(key: Key) -> str:
    """Return what is wrong with a key that no setting has: where it is said, or what may have been meant."""
    if key in SAID_ONCE:
        return f"unknown key; it is said once, by {'.'.join(SAID_ONCE[key])}"
    known = {".".join(each): each for each in all_keys()}
    near = difflib.get_close_matches(".".join(key), known, n=1, cutoff=0.5)
    if not near:
        near = difflib.get_close_matches(key[-1], [each[-1] for each in known.values()], n=1, cutoff=0.6)
    return f"unknown key; is {near[0]} meant?" if near else "unknown key"


def all_keys(cls: Any = RobotConfig, key: Key = ()) -> Iterator[Key]:
    """Yield the key of each table and each setting that a file may hold."""
    hints = typing.get_type_hints(cls)
    for f in dataclasses.fields(cls):
        inner = (*key, f.name)
        if inner not in SAID_ONCE:
            yield inner
            if dataclasses.is_dataclass(hints[f.name]):
                yield from all_keys(hints[f.name], inner)


@cache
def _model_of(cls: Any, key: Key = ()) -> type[BaseModel]:
    """Return a pydantic model with the dataclass' fields, unknown keys forbidden."""
    hints = typing.get_type_hints(cls)
    fields: dict[str, Any] = {}
    for f in dataclasses.fields(cls):
        inner = (*key, f.name)
        if inner in SAID_ONCE:
            continue
        made = f.default_factory is not dataclasses.MISSING
        default = f.default_factory() if f.default_factory is not dataclasses.MISSING else f.default
        fields[f.name] = (_model_of(hints[f.name], inner) if made else _checked(hints[f.name], f), default)
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
        inner = (*key, f.name)
        if inner in SAID_ONCE:
            continue
        value = getattr(model, f.name)
        hint = typing.get_type_hints(cls)[f.name]
        values[f.name] = _build(hint, value, inner) if isinstance(value, BaseModel) else value
    try:
        return cls(**values)
    except _BadKey:
        raise
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
