"""The robot's settings: the frozen dataclasses of every stage in one tree, and what must hold between them.

What a file or a command line says of them is read and checked in `robot/settings/`.
"""

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import reduce
from typing import Any

from lemtomap.areas.config import AreaConfig
from lemtomap.baseline.config import AmclConfig
from lemtomap.drivers.driver import DriverConfig
from lemtomap.drivers.hokuyo.session import HokuyoConfig
from lemtomap.drivers.kobuki.session import KobukiConfig
from lemtomap.errors import BadSetting
from lemtomap.grid.config import SlamConfig
from lemtomap.nav.config import ExploreConfig, NavConfig
from lemtomap.odometry import OdometryConfig
from lemtomap.robot.motion.docking import DockingConfig
from lemtomap.robot.motion.retreat import ReflexConfig
from lemtomap.robot.motion.safety import SafetyLimits
from lemtomap.robot.motion.teleop import TeleopConfig
from lemtomap.robot.motion.velocity import SmootherConfig
from lemtomap.robot.output.viewer_config import ViewerConfig
from lemtomap.se2 import Pose, pose
from lemtomap.settings import Range, refuse, within
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.whole.pruning import PruneConfig

Key = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class PortsConfig:
    """Serial ports; an empty path means: find it by its USB identity."""

    kobuki: str = ""
    hokuyo: str = ""


@dataclass(frozen=True, slots=True)
class DevicesConfig:
    """How the two devices are talked to."""

    kobuki: KobukiConfig = field(default_factory=KobukiConfig)
    hokuyo: HokuyoConfig = field(default_factory=HokuyoConfig)
    waiting: DriverConfig = field(default_factory=DriverConfig)


RANGES: dict[Key, Range] = {
    ("devices", "hokuyo", "view", "angle_min_rad"): Range(-2.1, 2.1, "a URG-04LX sees 240 degrees"),
    ("devices", "hokuyo", "view", "angle_max_rad"): Range(-2.1, 2.1, "a URG-04LX sees 240 degrees"),
    ("devices", "hokuyo", "view", "cluster"): Range(1, 99),
    ("devices", "hokuyo", "view", "skip"): Range(0, 9),
    ("devices", "hokuyo", "view", "count"): Range(0, 99),
}
"""Of settings that cannot say it themselves: the drivers know nothing of files."""


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
            refuse("must be 0 or 180, a laser looks level", roll_deg=self.roll_deg)

    @property
    def T_base_laser(self) -> Pose:  # noqa: N802 - frames live in names
        """Return where it is, float64 (3,): x m, y m, yaw rad, base frame."""
        return pose(self.x_m, self.y_m, self.yaw_rad)

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
    ("viewer", "body_m"): ("body", "radius_m"),
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
    devices: DevicesConfig = field(default_factory=DevicesConfig)
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
    teleop: TeleopConfig = field(default_factory=TeleopConfig)
    prune: PruneConfig = field(default_factory=PruneConfig)
    viewer: ViewerConfig = field(default_factory=ViewerConfig)
    amcl: AmclConfig = field(default_factory=AmclConfig)

    def __post_init__(self) -> None:
        for stage, source in SAID_ONCE.items():
            top = _with(getattr(self, stage[0]), stage[1:], value_at(self, source))
            object.__setattr__(self, stage[0], top)
        _check_relations(self)


class BadKey(BadSetting):
    """Settings cannot work; whoever read them from a file adds its name and the line.

    keys: those to change, any of them would do; the first one is told when none of them was set.
    """

    def __init__(self, reason: str, *keys: Key) -> None:
        super().__init__(f"{'.'.join(keys[0])}: {reason}")
        self.keys, self.reason = keys, reason


def value_at(config: Any, key: Key) -> Any:
    """Return a setting, or a table of settings."""
    return reduce(getattr, key, config)


def _with(config: Any, key: Key, value: Any) -> Any:
    """Return frozen settings with one of them, however deep, replaced."""
    name, *rest = key
    inner = _with(getattr(config, name), tuple(rest), value) if rest else value
    return dataclasses.replace(config, **{name: inner})


@dataclass(frozen=True, slots=True)
class _Relation:
    """What must hold between settings of different stages."""

    holds: bool
    reason: str
    """What is wrong when it does not."""
    keys: tuple[Key, ...]


def _check_relations(config: RobotConfig) -> None:
    """Refuse settings that do not go together. Raises BadKey."""
    for relation in _relations(config):
        if not relation.holds:
            raise BadKey(relation.reason, *relation.keys)


def _relations(config: RobotConfig) -> Iterator[_Relation]:
    body, radius_m = ("body", "radius_m"), config.body.radius_m
    laser, safety, period_s = config.laser, config.safety, config.nav.period_s
    away_m = math.hypot(laser.x_m, laser.y_m)
    yield _Relation(
        away_m <= radius_m,
        f"{away_m:g} m from the middle is outside the body (radius {radius_m:g} m)",
        (("laser", "x_m"), ("laser", "y_m"), body),
    )
    margin_m, skin_m = safety.side_margin_m, config.nav.collision.skin_m
    rule = f"must be below nav.collision.skin_m ({skin_m:g}), or the gate holds what navigation steers past"
    yield _Relation(
        margin_m < skin_m,
        f"{margin_m:g} {rule}",
        (("safety", "side_margin_m"), ("nav", "collision", "skin_m")),
    )
    rule = f"must be below safety.cycle_age_s ({safety.cycle_age_s:g}), or the gate stops between two cycles"
    yield _Relation(
        period_s < safety.cycle_age_s,
        f"{period_s:g} {rule}",
        (("nav", "period_s"), ("safety", "cycle_age_s")),
    )
    battery, key = config.devices.kobuki.battery, ("devices", "kobuki", "battery")
    for low, high in (("critical_v", "low_v"), ("low_v", "full_v")):
        yield _Relation(
            getattr(battery, low) < getattr(battery, high),
            f"{low} = {getattr(battery, low):g} must be below {high} = {getattr(battery, high):g}",
            ((*key, low), (*key, high)),
        )
