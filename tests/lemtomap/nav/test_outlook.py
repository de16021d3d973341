"""What the navigator keeps in mind between two looks."""

import numpy as np

from lemtomap.nav.config import NavConfig
from lemtomap.nav.motion.metric import MetricPlan
from lemtomap.nav.outlook import Lookout, ReachableArea
from lemtomap.nav.route.planner import Route
from lemtomap.nav.route.sliding import Target
from lemtomap.types import RouteEdge


def test_a_target_that_a_new_route_passes_by_does_not_make_the_goal_look_near():
    lookout = Lookout(None, None, NavConfig())
    lookout.plan = MetricPlan(None, None, np.empty((0, 2)), 2.0, (0.0, 0.0))
    lookout.outlook = ReachableArea(
        0.0, None, Target(1, 7, (0, 0), final=False, proven=True), lookout.plan, False
    )
    edges = (RouteEdge(1, 7, 5.0, 12.0), RouteEdge(2, 9, 6.0, 15.0))
    assert lookout.remaining_m(Route((4, 7, 9), edges, 27.0)) == 8.0
    assert lookout.remaining_m(Route((4, 8, 9), edges, 27.0)) == 11.0
