"""Section 5-2-2: two tasks, there and back twice, over the topological map and over the grid with AMCL."""

import json
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from lemtomap.robot.child import python
from tools.bench.thesis_parts.published import TRAJECTORY_M

CYCLE_S = 0.1  # of the control loop, in which the legs' speeds are written down
KINDS = {"topological": ("LEMTOMap", "#1d5fa8"), "metric": ("baseline: AMCL, whole grid", "#c0392b")}
MEANS = ("time_s", "path_m", "first_plan_ms", "planner_cpu_s")
SUMS = ("stops", "contacts")


@dataclass(frozen=True, slots=True)
class Task:
    """One building and how far to drive in it."""

    name: str
    world: str

    @property
    def metres(self) -> float:
        """Return the length of one leg, about."""
        return TRAJECTORY_M[self.name]

    def run(self, out: Path) -> dict[str, Any]:
        """Let both navigators drive; return their legs."""
        out.mkdir(parents=True, exist_ok=True)
        command = python("-m", "tools.bench.nav", "tasks", "--world", self.world)
        more = ["--metres", str(self.metres), "--seeds", "1", "--out", str(out)]
        with (out / "told.txt").open("w") as told:
            subprocess.run([*command, *more], check=True, stdout=told)  # noqa: S603 - our own module
        return {"legs": json.loads((out / "nav_tasks.json").read_text())}


def means(legs: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Return the mean leg of each navigator, and what counts in all."""
    found = {}
    for kind in KINDS:
        mine = [leg for leg in legs if leg["kind"] == kind]
        found[kind] = {key: float(np.mean([leg[key] for leg in mine])) for key in MEANS}
        found[kind] |= {key: float(sum(leg[key] for leg in mine)) for key in SUMS}
        found[kind] |= {"legs": len(mine), "reached": sum(leg["state"] == "arrived" for leg in mine)}
    return found


def draw_legs(legs: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Draw speed and distance over time of the longest leg of each navigator (figure 5-13)."""
    figure = Figure(figsize=(11, 3.4), dpi=100, layout="constrained")
    speed, way = figure.subplots(1, 2)
    for kind, (title, colour) in KINDS.items():
        leg = max((leg for leg in legs if leg["kind"] == kind), key=lambda leg: leg["time_s"])
        v_mps = np.array(leg["v_mps"])
        at_s = CYCLE_S * np.arange(len(v_mps))
        speed.plot(at_s, v_mps, color=colour, linewidth=0.9, label=title)
        way.plot(at_s, CYCLE_S * np.cumsum(v_mps), color=colour, label=title)
    speed.set_title("speed asked for (m/s)", fontsize=10)
    way.set_title("distance (m)", fontsize=10)
    way.legend(fontsize=8)
    for axes in (speed, way):
        axes.set_xlabel("time (s)", fontsize=8)
        axes.set_ylim(bottom=0)
    figure.savefig(path)
