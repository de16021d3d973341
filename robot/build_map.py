"""Putting the halves of a mapper together from settings: all that a recorded log needs of a robot."""

from lemtomap.areas.segmentation import AreaSegmenter
from lemtomap.errors import BadSetting
from lemtomap.grid import SLAMS, GridSlam
from lemtomap.robot.config import RobotConfig
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.loops import LoopRecogniser
from lemtomap.topo.mapper import TopoMapper


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
