"""The recorded drives of section 5-2-1: the robot driven round at constant speed, nothing else running."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose, between
from lemtomap.sim import worlds
from lemtomap.sim.carmen import record_tour
from lemtomap.sim.route import FloorRoutePlanner
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.tours import ScriptedTour, TourConfig, plan_tour
from lemtomap.sim.world import World
from tools.truth.tour_error import error_m, truth_and_odometry

SPACING_M = 15.0  # of the places a drive visits: it crosses the building as the thesis' did, not room by room
SPEED_MPS = 0.5  # table 5-2: 168 m in 341 s
OUT_SHARE = (
    0.55  # of the time; then it comes home, and passes known places as the thesis' drive did in the end
)

WRONG_M, WRONG_RAD = 0.5, 0.2  # a closure this far from the truth is another place


@dataclass(frozen=True, slots=True)
class Drive:
    """One recorded drive through one building."""

    name: str
    world: str
    duration_s: float

    @property
    def key(self) -> str:
        """Return a name for files that tells drives of other buildings apart."""
        place = "".join(c if c.isalnum() else "-" for c in Path(self.world).stem)
        return f"{self.name}-{place}-{self.duration_s:.0f}"

    def log(self, out: Path) -> Path:
        """Record the drive unless that was done before; return its log. Raises BadWorld."""
        path = out / f"{self.key}.clf"
        if not path.exists():
            partial = path.with_suffix(".part")
            world = worlds.load(self.world)
            simulator = Simulator(world, 0)
            record_tour(simulator, round_tour(world, self.duration_s), partial, self.duration_s)
            simulator.close()
            partial.rename(path)
        return path


def round_tour(world: World, duration_s: float) -> ScriptedTour:
    """Return a drive of at least so long: out through the building, home the shortest way, out again."""
    config = TourConfig(speed_mps=SPEED_MPS, spacing_m=SPACING_M)
    out = plan_tour(world, OUT_SHARE * duration_s, config).path
    home = FloorRoutePlanner(world.raster).path(tuple(out[-1]), tuple(out[0]))
    return ScriptedTour(np.concatenate([out, home, out]), config)


def wrong_closures(log: Path, picture: Path) -> int:
    """Return how many loop-closing edges of a finished map join places that are not where they say."""
    stamps, truth = _stamped_truth(log)
    with np.load(picture) as saved:
        born, closures = saved["born"], saved["closure"]
    index = np.searchsorted(stamps, born[:, 1] - 1e-6)
    at = {int(node_id): truth[min(i, len(truth) - 1)] for (node_id, _), i in zip(born, index, strict=True)}
    return sum(
        is_wrong(between(between(at[int(row[0])], at[int(row[1])]), row[2:]))
        for row in closures
        if {int(row[0]), int(row[1])} <= at.keys()
    )


def is_wrong(off: Pose) -> bool:
    """Return True if a closure is so far from the truth that it means another place."""
    return bool(np.hypot(off[0], off[1]) > WRONG_M or abs(off[2]) > WRONG_RAD)


def _stamped_truth(log: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return stamps (N,) and T_world_base (N, 3) of a simulated log."""
    rows = [line.split() for line in log.read_text().splitlines() if line.startswith("TRUEPOS")]
    numbers = np.array([[float(value) for value in (row[7], *row[1:4])] for row in rows])
    return numbers[:, 0], numbers[:, 1:]


def local_and_whole_error_m(
    log: Path, track: NDArray[np.float64], over_m: float = 10.0
) -> tuple[float, float]:
    """Return how wrong a track is: the mean error over `over_m` of way, and the mean error as a whole.

    track: T_map_base of each scan, float64 (N, 3). Whole: after the best rigid fit onto the truth.
    """
    truth, _ = truth_and_odometry(log)
    whole = error_m(track[:, :2], truth)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(truth, axis=0).T))])
    errors = []
    for begin in np.arange(0.0, way[-1] - over_m, over_m / 2):
        piece = slice(*np.searchsorted(way, [begin, begin + over_m]))
        if piece.stop - piece.start > 10:
            errors.append(float(error_m(track[piece, :2], truth[piece]).mean()))
    return float(np.mean(errors)), float(whole.mean())
