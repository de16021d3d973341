"""Missions ask for goals, and know when they are done."""

from types import SimpleNamespace

import pytest

from lemtomap.errors import BadSetting
from lemtomap.nav.types import NavOutput, NavState
from lemtomap.robot.exchange import MissionState
from lemtomap.robot.missions.missions import GoTo, MissionInput, parse_mission
from lemtomap.robot.missions.nodes_by_distance import farthest_node
from lemtomap.topo.events import LevelChanged
from lemtomap.types import RouteEdge, Twist


class Line:
    """Nodes 1 to 9 in a row, a metre apart; node 4 is called kitchen."""

    version = 1

    def has_node(self, node_id):
        return 1 <= node_id <= 9

    def area_nodes(self, place):
        return {"area:7": [3, 4], "office 3": [3, 4]}.get(place, [])

    def node_of(self, name):
        return 4 if name == "kitchen" else None

    def edges_of(self, node_id):
        return [RouteEdge(min(node_id, n), n, 1.0, 2.5) for n in (node_id - 1, node_id + 1) if 1 <= n <= 9]


def moment(state, cycle, here=3, text=""):
    output = NavOutput(0.1 * cycle, Twist(), state, text=text, cycle=cycle)
    view = SimpleNamespace(associated_id=here, changed={}, graph_version=0)
    return MissionInput(0.1 * cycle, view, Line(), output, None, None)


@pytest.mark.parametrize(
    ("place", "node"), [("7", 7), ("kitchen", 4), ("start", 1), ("here", 3), ("far", 9)], ids=str
)
def test_a_place_is_a_number_a_name_or_a_word(place, node):
    order = parse_mission(f"goto:{place}").step(moment(NavState.IDLE, 1))
    assert order.goal.node_id == node


def test_an_old_arrival_does_not_end_a_new_mission():
    mission = GoTo("5")
    assert mission.step(moment(NavState.ARRIVED, 1)).goal.node_id == 5
    assert mission.step(moment(NavState.ARRIVED, 1)).state is MissionState.RUNNING
    assert mission.step(moment(NavState.DRIVING, 2)).state is MissionState.RUNNING
    assert mission.step(moment(NavState.ARRIVED, 3)).state is MissionState.DONE


def test_a_failure_says_why():
    mission = GoTo("5")
    mission.step(moment(NavState.IDLE, 1))
    order = mission.step(moment(NavState.FAILED, 2, text="the corridor is closed"))
    assert (order.state, order.text) == (MissionState.FAILED, "5 not reached: the corridor is closed")
    unknown = GoTo("99").step(moment(NavState.IDLE, 1))
    assert (unknown.state, unknown.text) == (MissionState.FAILED, "there is no place '99' in this map")


def test_missions_follow_one_another():
    mission = parse_mission("goto:5, goto:start")
    assert mission.step(moment(NavState.IDLE, 1)).goal.node_id == 5
    assert mission.step(moment(NavState.ARRIVED, 2)).state is MissionState.RUNNING
    assert mission.step(moment(NavState.ARRIVED, 3)).goal.node_id == 1
    assert mission.step(moment(NavState.ARRIVED, 4)).state is MissionState.DONE


def test_a_tour_passes_near_every_node_and_comes_back():
    mission, here, cycle, visited = parse_mission("tour"), 3, 0, []
    for _ in range(40):
        order = mission.step(moment(NavState.IDLE if not visited else NavState.DRIVING, cycle, here))
        if order.state is MissionState.DONE:
            break
        if order.goal is not None:
            visited.append(order.goal.node_id)
        cycle += 1
        target = visited[-1]
        if here == target:
            order = mission.step(moment(NavState.ARRIVED, cycle, here))
            if order.state is MissionState.DONE:
                break
            if order.goal is not None:
                visited.append(order.goal.node_id)
            cycle += 1
        here += (target > here) - (target < here)
    assert order.state is MissionState.DONE
    assert "0 places not reached" in order.text
    assert max(visited) >= 6
    assert visited[-1] == 1


def test_a_tour_goes_on_after_a_place_it_cannot_reach():
    mission = parse_mission("tour")
    first = mission.step(moment(NavState.IDLE, 1, 1)).goal.node_id
    order = mission.step(moment(NavState.FAILED, 2, 1))
    assert order.state is MissionState.RUNNING
    assert order.goal.node_id != first


@pytest.mark.parametrize("text", ["", "goto:", "fly", "explore,", "goto"])
def test_what_is_no_mission_is_refused_by_name(text):
    with pytest.raises(BadSetting, match=f"mission '{text.split(',')[-1]}'"):
        parse_mission(text)


def test_the_farthest_node_is_farthest_by_way_not_by_number():
    assert farthest_node(Line(), 8) == 1
    assert farthest_node(Line(), 2) == 9


def test_a_lift_is_told_to_the_map_between_two_missions():
    mission = parse_mission("level:2,goto:5")
    order = mission.step(moment(NavState.IDLE, 1))
    assert list(order.events) == [LevelChanged(2)]
    assert order.state is MissionState.RUNNING
    assert mission.step(moment(NavState.IDLE, 2)).goal.node_id == 5
    for wrong in ("level:", "level:up", "level"):
        with pytest.raises(BadSetting, match="level:N"):
            parse_mission(wrong)


@pytest.mark.parametrize("place", ["area:7", "office 3"])
def test_going_to_an_area_goes_to_its_node_with_the_shortest_way(place):
    assert GoTo(place).step(moment(NavState.IDLE, 1, here=8)).goal.node_id == 4
    assert GoTo(place).step(moment(NavState.IDLE, 1, here=1)).goal.node_id == 3
