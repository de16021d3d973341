"""How the recording is laid out on the screen: the default blueprint, its colours and its legend."""

from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from lemtomap import palette
from lemtomap.palette import rgb

EYE_HEIGHT_M = 17.0  # shows a 20 m window whole

ABOUT = """\
**White** is free, **black** is wall, **grey** has not been seen
(or has been forgotten: the window moves with the robot).

| | |
|---|---|
| red disc, white arrow | the robot and its heading |
| red dots | the laser scan |
| orange arrows | the particles: where else it may be |
| dark blue dots | topological nodes; **pink** is the associated one |
| green, amber, red lines | edges: driven, near neighbour, loop closing |
| pink line | the route over nodes |
| green line, green dot | the way to the sliding goal |

In a simulated run the tab *Truth* shows the building as it is,
the true track (green) and the believed one (orange).

Press play, or drag the time line below.
"""


def blueprint(world: tuple[float, float, float] | None = None) -> rrb.Blueprint:
    """Return the default screen: the map large, beside it costmap, velocities and timing, the log below.

    `world` is the middle x, y and the extent of a simulated building, metres: it gets a tab of its own.
    """
    plots = rrb.Vertical(
        rrb.Tabs(
            _costmap_view(),
            *([_truth_view(*world)] if world is not None else []),
            rrb.TextDocumentView(origin="about", name="How to read this"),
            active_tab=0,
        ),
        rrb.TimeSeriesView(origin="velocity/forward", name="Forward speed (m/s)"),
        rrb.TimeSeriesView(origin="velocity/turn", name="Turn rate (rad/s)"),
        rrb.Tabs(
            rrb.TimeSeriesView(origin="quality", name="Pose quality"),
            rrb.TimeSeriesView(origin="timing", name="Time per cycle (ms)"),
            rrb.TimeSeriesView(origin="health", name="Health"),
        ),
        row_shares=[3, 1.4, 1.4, 1.4],
    )
    main = rrb.Vertical(
        _map_view(),
        rrb.StateTimelineView(origin="state", name="What it is doing"),
        rrb.TextLogView(origin="log", name="Log"),
        row_shares=[6, 0.9, 1.3],
    )
    return rrb.Blueprint(
        rrb.Horizontal(main, plots, column_shares=[1.7, 1]),
        rrb.TimePanel(state="collapsed", timeline="run", play_state="following"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )


def _map_view() -> rrb.Spatial3DView:
    """Return the view from above that follows the robot."""
    return rrb.Spatial3DView(
        origin="grid/eye",  # moves with the robot, does not turn with it
        contents=["+ /grid/**", "- /grid/costmap"],
        name="Map and robot",
        eye_controls=_eye(EYE_HEIGHT_M),
        line_grid=False,
        background=[38, 42, 48],
        overrides=_styles(),
    )


def _costmap_view() -> rrb.Spatial3DView:
    """Return the closer view of what navigation avoids."""
    contents = [
        "+ /grid/costmap",
        "+ /grid/window",
        "+ /grid/plan/**",
        "+ /grid/robot/**",
        "+ /grid/eye",
    ]
    return rrb.Spatial3DView(
        origin="grid/eye",  # moves with the robot, does not turn with it
        contents=contents,
        name="Costmap and plan",
        eye_controls=_eye(0.6 * EYE_HEIGHT_M),
        line_grid=False,
        background=[38, 42, 48],
        overrides=_styles(),
    )


def _truth_view(x_m: float, y_m: float, extent_m: float) -> rrb.Spatial3DView:
    """Return the simulated building from above, with the true and the believed track."""
    return rrb.Spatial3DView(
        origin="truth",
        name="Truth (simulator)",
        eye_controls=_eye(1.1 * extent_m, x_m, y_m),
        line_grid=False,
        background=[38, 42, 48],
    )


def _eye(height_m: float, x_m: float = 0.0, y_m: float = 0.0) -> rrb.EyeControls3D:
    """Return an eye straight above a point, x to the right."""
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=[x_m, y_m - 0.01, height_m],
        look_target=[x_m, y_m, 0.0],
        eye_up=[0.0, 1.0, 0.0],
    )


def _styles() -> dict[Any, list[rrb.VisualizableArchetype]]:
    """Return the colours of everything whose data does not carry one."""
    return {
        "grid/robot/scan": [rr.Points3D.from_fields(colors=rgb(palette.SCAN), radii=0.03)],
        "grid/plan/route": [rr.LineStrips3D.from_fields(colors=rgb(palette.ROUTE), radii=0.05)],
        "grid/plan/path": [rr.LineStrips3D.from_fields(colors=rgb(palette.PATH), radii=0.035)],
        "grid/plan/goal": [rr.Points3D.from_fields(colors=rgb(palette.PATH), radii=0.12)],
    }
