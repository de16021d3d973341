"""Doors and areas as they are found on the way."""

from dataclasses import replace

import numpy as np
import pytest

from lemtomap.areas.book import AreaBook
from lemtomap.areas.edit import merge_areas, name_area, split_area
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import FOR_EVER_S
from lemtomap.types import EdgeType
from tests.lemtomap.areas.rooms import Walk, window


@pytest.fixture
def walk(tmp_path):
    walk = Walk(tmp_path / "map.lemto")
    yield walk
    walk.store.close()


def doors(walk):
    return AreaBook(walk.store).doors()


def test_one_look_makes_no_door_and_the_next_from_elsewhere_does(walk):
    walk.look(window())
    assert doors(walk) == []
    walk.look(window(), x=-1.5)
    (door,) = doors(walk)
    assert door.width_m == pytest.approx(0.9, abs=0.06)
    assert door.x_m + walk.at[door.node][0] == pytest.approx(0.0, abs=0.1)


def test_a_robot_that_stands_still_sees_one_look_however_often(walk):
    for _ in range(20):
        walk.look(window())
        walk.way_m -= 0.5
        walk.stamp_s += 5.0
    assert doors(walk) == []


def test_nodes_on_both_sides_of_a_door_are_of_two_areas(walk):
    walk.looks(window(), 3)
    assert walk.areas() == [1, 1, 1, 2, 2, 2]


def test_without_a_door_all_nodes_are_of_one_area(walk):
    walk.looks(window(gap_m=4.5), 3)
    assert walk.areas() == [1] * 6


def test_a_door_knows_the_edges_that_lead_through_it(walk):
    walk.looks(window(), 3)
    (door,) = doors(walk)
    (edge,) = door.edges
    assert {walk.store.edge(edge).source_id, walk.store.edge(edge).target_id} == {3, 4}


def test_driving_through_a_door_is_counted_once_a_pass(walk):
    walk.looks(window(), 3)
    for x in (-0.5, -0.3, -0.1, 0.1, 0.3, 0.5):
        walk.look(window(), x)
    assert doors(walk)[0].passed == 1
    for x in (0.3, 0.1, -0.1, -0.3):
        walk.look(window(), x)
    assert doors(walk)[0].passed == 2


def test_a_person_in_a_door_neither_loses_nor_shuts_it(walk):
    walk.looks(window(), 3)
    walk.looks(window(person=True), 20)
    (door,) = doors(walk)
    assert (door.seen_shut, door.is_shut) == (0, False)
    assert walk.store.edge(door.edges[0]).blocked_until_s == 0.0


def test_a_door_seen_shut_closes_its_edges_for_a_while_and_is_kept(walk):
    walk.looks(window(), 3)
    walk.looks(window(shut=True), 3)
    (door,) = doors(walk)
    assert door.is_shut
    assert door.seen_shut > 0
    until_s = walk.store.edge(door.edges[0]).blocked_until_s
    assert walk.stamp_s < until_s < walk.stamp_s + 61.0


def test_a_door_seen_open_again_opens_its_edges(walk):
    walk.looks(window(), 3)
    walk.looks(window(shut=True), 3)
    walk.looks(window(), 2)
    (door,) = doors(walk)
    assert not door.is_shut
    assert walk.store.edge(door.edges[0]).blocked_until_s == 0.0


def test_an_edge_that_a_person_closed_stays_closed_when_the_door_opens(walk):
    walk.looks(window(), 3)
    edge = walk.store.edge(doors(walk)[0].edges[0])
    walk.graph.put_edge(replace(edge, blocked_until_s=FOR_EVER_S))
    walk.looks(window(shut=True), 3)
    walk.looks(window(), 2)
    assert walk.store.edge(edge.edge_id).is_closed


def test_what_was_taken_for_a_door_goes_when_the_floor_lies_open_and_its_id_is_not_used_again(walk):
    walk.looks(window(), 2)
    walk.looks(window(gap_m=4.5), 30)
    assert doors(walk) == []
    assert walk.areas() == [1] * 6
    walk.looks(window(), 3)
    assert [door.id for door in doors(walk)] == [2]


def test_a_door_that_the_robot_has_passed_is_not_argued_away(walk):
    walk.looks(window(), 3)
    for x in (-0.3, -0.1, 0.1, 0.3):
        walk.look(window(), x)
    walk.looks(window(gap_m=4.5), 60)
    assert len(doors(walk)) == 1


def test_a_closure_through_a_wall_that_nobody_has_driven_merges_no_areas(walk):
    left, right = walk.add(-2.5, 2.5, to=1), walk.add(2.5, 2.5, to=6)
    walk.looks(window(), 3)
    walk.join(left, right, EdgeType.LOOP_CLOSING, proven=False)
    walk.looks(window(), 1)
    assert walk.areas() == [1, 1, 1, 2, 2, 2, 1, 2]


def test_a_way_round_without_a_door_merges_two_areas_and_the_older_id_stays(walk):
    walk.looks(window(), 3)
    name_area(walk.store, "2", "kitchen")
    beyond = [walk.add(-2.5, 8.0, to=1), walk.add(2.5, 8.0)]
    walk.join(beyond[-1], 6)
    walk.looks(window(), 2)
    assert set(walk.areas()) == {2}  # a person's name counts for more than a lower number
    area = AreaBook(walk.store).area(1)
    assert (area.area_id, area.name, area.aliases) == (2, "kitchen", (1,))


def test_a_second_tour_changes_no_area(walk):
    walk.looks(window(), 5)
    before = walk.areas()
    for x in (-2.0, -1.0, 1.0, 2.0, 1.0, -1.0, -2.0):
        walk.look(window(), x, here=2)
    assert walk.areas() == before
    assert len(doors(walk)) == 1


def test_what_a_person_merged_stays_merged_while_the_robot_drives_on(walk):
    walk.looks(window(), 3)
    merge_areas(walk.store, "1", "2")
    walk.graph.forget(*walk.at)
    new = walk.add(1.5, 1.0)
    walk.looks(window(), 5)
    assert set(walk.areas()) == {1}
    assert walk.graph.node(new).area_id == 1


def test_what_a_person_split_stays_split_and_new_nodes_go_to_the_nearer_part(walk):
    walk.looks(window(gap_m=4.5), 3)
    split_area(walk.store, "1", 1, 6)
    walk.graph.forget(*walk.at)
    parts = walk.areas()
    assert sorted(set(parts)) == [1, 2]
    new = walk.add(2.6, 0.5)
    walk.looks(window(gap_m=4.5), 5)
    assert walk.areas()[:6] == parts
    assert walk.graph.node(new).area_id == parts[-1]


def test_two_named_areas_are_never_merged_by_the_robot(walk):
    walk.looks(window(), 3)
    name_area(walk.store, "1", "kitchen")
    name_area(walk.store, "2", "office 3")
    walk.join(2, 5)
    walk.segmenter.config = type(walk.segmenter.config)(evidence_gone=2.0)
    walk.looks(window(gap_m=4.5), 10)
    assert doors(walk) == []
    assert walk.areas() == [1, 1, 1, 2, 2, 2]


def test_two_doors_at_one_place_prove_to_be_one_and_the_older_id_stays(walk):
    walk.looks(window(), 3)
    (door,) = doors(walk)
    AreaBook(walk.store).add_door(door)
    walk.segmenter._asked.clear()
    walk.looks(window(), 1)
    assert [each.id for each in doors(walk)] == [door.id]


def test_a_map_read_again_has_its_doors_and_areas(walk, tmp_path):
    walk.looks(window(), 3)
    walk.store.close()
    with TopoStore.open(tmp_path / "map.lemto") as store:
        (door,) = AreaBook(store).doors()
        assert door.edges
        assert [AreaBook(store).area_of(k) for k in range(1, 7)] == [1, 1, 1, 2, 2, 2]
        assert [area.id for area in AreaBook(store).areas()] == [1, 2]


def test_who_looks_on_is_told_the_areas_and_where_the_doors_are(walk):
    walk.looks(window(), 3)
    assert walk.segmenter.area_of == {1: 1, 2: 1, 3: 1, 4: 2, 5: 2, 6: 2}
    assert walk.segmenter.doors_grid[1] == pytest.approx(np.array([[0.0, -0.45], [0.0, 0.45]]), abs=0.1) or (
        walk.segmenter.doors_grid[1] == pytest.approx(np.array([[0.0, 0.45], [0.0, -0.45]]), abs=0.1)
    )
