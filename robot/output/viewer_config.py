"""How much the viewer takes."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ViewerConfig:
    """How much the viewer takes; rates in Hz of run time."""

    window_hz: float = 1.0  # 160 kB each before compression; the map changes slower than the robot
    costmap_hz: float = 0.5  # four bytes a cell
    pose_hz: float = 10.0  # dimos issue 1509: faster only fills memory
    scan_hz: float = 2.0  # 8 kB each, which do not compress
    plan_hz: float = 2.5
    plot_hz: float = 5.0
    timing_hz: float = 2.0
    part_hz: float = 0.2  # how often the file's size is looked at
    preview_s: float = 15.0  # between two pictures of the map in the run's folder
    flush_s: float = 2.0  # of wall time between two writes, unless somebody watches: each costs 1 kB a path
    close_s: float = 3.0  # for the last bytes to reach the file
    body_m: float = 0.18  # radius of the robot as drawn
