"""What the thesis itself found (chapter 5), to stand beside ours."""

SIZE_KB = {"small": (24, 710), "large": (72, 2671)}
"""Table 5-1: LEMTOMap-V0.5, which kept no localisation data, and the baseline."""

NAVIGATION = {
    "first_plan_ms": ("CPU time to the global plan, ms", (17.74, 24.29), (24.19, 97.62)),
    "planner_cpu_s": ("total CPU time of the planners, s", (18.91, 16.01), (74.48, 89.08)),
    "time_s": ("time to the goal, s", (88.66, 82.90), (375.25, 341.27)),
    "path_m": ("distance travelled, m", (38.81, 38.25), (171.56, 167.86)),
}
"""Table 5-2, short and long trajectory: LEMTOMap-V0.5, baseline."""

TRAJECTORY_M = {"small": 40.0, "large": 170.0}
"""Section 5-2-2: how long the two navigation tasks are, about."""

CURVES = {
    "small": "2014, figures 5-3 to 5-5: LEMTOMap-V0.5 below the baseline in CPU and memory throughout; its "
    "metric mapping grew slightly with each shift of the window, its topological mapping linearly.",
    "large": "2014, figures 5-6 to 5-8: below the baseline until two thirds of the drive, then above it in "
    "CPU: the load of topological mapping grew with the graph, so its CPU time grew with the drive's square. "
    "The baseline's memory grew with the area mapped, its CPU load stayed level.",
}
MAPS = {
    "small": "2014, figure 5-9: both maps usable.",
    "large": "2014, figures 5-10 and 5-11: the baseline's map of the large building was broken in one part "
    "and could not be navigated there; the topological map could.",
}
STAMMER = (
    "2014, figure 5-13: the robot slowed down whenever the next node was handed to the metric planner: "
    "stammering, a staircase in the distance travelled."
)
