"""A picture a plan: true rooms, nodes and floor coloured by area, doors found, missed and false."""

from pathlib import Path

import numpy as np

from lemtomap.sim.world import World
from tools.bench.rooms_parts.drive import Drive
from tools.bench.rooms_parts.judge import Verdict

FOUND, MISSED, FALSE, LEFT_OUT = "#2a9d4b", "#d62828", "#e76f00", "#888888"


def picture(world: World, drive: Drive, verdict: Verdict, title: str, path: Path) -> None:
    """Draw what the robot made of a plan."""
    import matplotlib as mpl  # noqa: PLC0415

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    raster, colours = world.raster, plt.get_cmap("tab20")
    shown = np.full((*raster.free.shape, 3), 0.85)
    shown[raster.free] = 1.0
    labelled = verdict.cells > 0
    shown[labelled] = 0.5 + 0.5 * colours(verdict.cells[labelled] * 7 % 20)[:, :3]
    shown[raster.occupied] = 0.1
    (x0, y0), (rows, cols), step = raster.origin_m, raster.free.shape, raster.resolution_m
    figure, axis = plt.subplots(figsize=(16, max(4.0, 16 * rows / cols + 0.5)), layout="constrained")
    axis.imshow(shown, origin="lower", extent=(x0, x0 + cols * step, y0, y0 + rows * step))
    for room in world.truth.rooms:
        if room.outline:
            axis.plot(*np.array((*room.outline, room.outline[0])).T, ":", color="#1f4e9b", lw=0.9)
    track = np.array([each.T_world_base[:2] for each in drive.steps]).reshape(-1, 2)
    axis.plot(*track.T, color="#bbbbbb", lw=0.5)
    for node, pose in drive.T_world_node.items():
        area = drive.area_of.get(node, 0)
        axis.plot(*pose[:2], "o", ms=4, mec="#222222", mew=0.4, color=colours(area * 7 % 20))
        axis.annotate(f"{node}:{area}", (float(pose[0]), float(pose[1])), fontsize=4)
    matched = dict(verdict.match.pairs)
    for index, door in enumerate(world.truth.doors):
        colour = FOUND if index in matched else MISSED if verdict.counts[index] else LEFT_OUT
        axis.plot(*np.array(door.ends).T, "-", lw=3, color=colour, solid_capstyle="butt")
    right = set(matched.values())
    for index, (x, y, width_m, number) in enumerate(drive.doors):
        colour = FOUND if index in right else FALSE
        axis.plot(x, y, "x", ms=8, color=colour)
        axis.annotate(f"D{number} {width_m:.2f}", (x, y), fontsize=6, color=colour)
    axis.set_title(
        f"{title}\ndoor lines: green found, red missed, grey not counted; crosses: orange false", fontsize=9
    )
    inner = np.argwhere(raster.free)
    (r0, c0), (r1, c1) = inner.min(axis=0), inner.max(axis=0)
    axis.set_xlim(x0 + c0 * step - 1.0, x0 + c1 * step + 1.0)
    axis.set_ylim(y0 + r0 * step - 1.0, y0 + r1 * step + 1.0)
    figure.savefig(path, dpi=110)
    plt.close(figure)
