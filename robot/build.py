"""Putting a robot together from its settings."""

from functools import partial
from pathlib import Path

from lemtomap.areas.segmentation import AreaSegmenter
from lemtomap.errors import BadSetting
from lemtomap.grid import DEFAULT_SLAM, SLAMS, GridSlam
from lemtomap.nav.navigator import Navigator
from lemtomap.pipeline import Mapper
from lemtomap.robot.base import BaseStep
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.core import RobotCore
from lemtomap.robot.exchange import Exchange
from lemtomap.robot.mapping import MappingStep
from lemtomap.robot.navigating import NavigationStep
from lemtomap.topo.file.reader import TopoReader
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.loops import LoopRecogniser
from lemtomap.topo.mapper import TopoMapper
from lemtomap.topo.whole.pruning import prune


def build_slam(name: str, config: RobotConfig, seed: int) -> GridSlam:
    """Return the grid SLAM of this name. Raises BadSetting."""
    maker = SLAMS.get(name)
    if maker is None:
        raise BadSetting(f"slam '{name}': must be one of {', '.join(SLAMS)}")
    return maker(config.slam, seed)


def build_topo(slam: str, config: RobotConfig, store: TopoStore) -> TopoMapper:
    """Return the topological half of the mapper over a window SLAM of this name.

    The growing grid closes its own loops and is far too large to search.
    """
    recogniser = None if slam == "gmapping" else LoopRecogniser(config.loops)
    areas = None if slam == "gmapping" else AreaSegmenter(config.areas)
    return TopoMapper(config.topo, store, recogniser=recogniser, areas=areas)


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
