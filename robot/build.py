"""Putting a robot together from its settings."""

from functools import partial
from pathlib import Path

from lemtomap.grid import DEFAULT_SLAM
from lemtomap.nav.navigator import Navigator
from lemtomap.pipeline import Mapper
from lemtomap.robot.base import BaseStep
from lemtomap.robot.build_map import build_slam, build_topo
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.core import RobotCore
from lemtomap.robot.exchange import Exchange
from lemtomap.robot.mapping import MappingStep
from lemtomap.robot.navigating import NavigationStep
from lemtomap.topo.file.reader import TopoReader
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.whole.pruning import prune


def build_core(
    config: RobotConfig, map_path: Path, *, slam: str = DEFAULT_SLAM, seed: int = 0, durable: bool = True
) -> RobotCore:
    """Return a robot that maps into `map_path`, a new file or an existing map. Raises BadMap, BadSetting."""
    exchange = Exchange()
    known = map_path.exists()
    store = (TopoStore.open if known else TopoStore.create)(
        map_path, durable=durable and config.topo.durable, commit_every_s=config.topo.commit_every_s
    )
    if known:
        prune(store, config.prune)
    topo = build_topo(slam, config, store)
    mapping = MappingStep(Mapper(lambda: build_slam(slam, config, seed), topo), exchange)
    reader = partial(TopoReader, map_path, is_checked=True)
    navigation = NavigationStep(Navigator(config.nav), exchange, reader)
    return RobotCore(exchange, BaseStep(config, exchange), mapping, navigation, config.devices)
