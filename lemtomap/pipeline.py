"""The mapping half of the thesis' figure 3-1: a scan meets the window, then the topological map."""

from lemtomap.grid import GridSlam
from lemtomap.topo.mapper import TopoMapper
from lemtomap.types import GridView, MapView, Odometry, Scan, SlamUpdate


class Mapper:
    """Scan and odometry in, map view out. Owned by the mapping thread."""

    def __init__(self, slam: GridSlam, topo: TopoMapper) -> None:
        self.slam = slam
        self.topo = topo
        self._grid: GridView | None = None

    def update(self, scan: Scan, odometry: Odometry) -> SlamUpdate:
        """Use one scan; odometry is the base at the scan's stamp."""
        update = self.slam.update(scan, odometry)
        if self._grid is None or update.integrated:
            self._grid = self.slam.view()  # between integrations the window does not change
        self.topo.update(update, self._grid, self.slam.points_base())
        return update

    def view(self) -> MapView:
        """Return an immutable snapshot; needs at least one scan."""
        return self.topo.view(self.slam.particles())
