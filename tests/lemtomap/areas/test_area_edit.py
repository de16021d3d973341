"""What a person does with areas: names, merges, splits, kinds, undo; exports and lists of them."""

import json
import sqlite3
import xml.etree.ElementTree as ET
from contextlib import closing
from itertools import pairwise

import numpy as np
import pytest

from lemtomap.areas import edit, export
from lemtomap.areas.book import AreaBook
from lemtomap.areas.find import find_areas
from lemtomap.areas.places import places
from lemtomap.errors import BadInput, BadMap
from lemtomap.robot.cli import map_file
from lemtomap.topo.file import edit as node_edit
from lemtomap.topo.file import journal
from lemtomap.topo.file.reader import TopoReader
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Place
from lemtomap.topo.place.codec import encode_place
from tests.lemtomap.areas.rooms import Walk, window

XS = (-2.5, -1.5, -0.5, 0.5, 1.5, 2.5)


@pytest.fixture
def path(tmp_path):
    """Two rooms with a door between them: areas 1 and 2, three nodes each."""
    walk = Walk(tmp_path / "map.lemto")
    walk.looks(window(), 3)
    walk.store.close()
    return tmp_path / "map.lemto"


@pytest.fixture
def store(path):
    with TopoStore.open(path) as store:
        yield store


def remember(store):
    """Let each node remember the walls that are seen from it, also through the gap."""
    grid = window()
    rows, cols = np.nonzero(grid.occupancy >= 50)
    walls = np.column_stack([cols, rows]) * grid.resolution_m + grid.origin_m + 0.5 * grid.resolution_m
    for node_id, x in enumerate(XS, start=1):
        beyond = walls[:, 0] * x < 0.0
        at_gap_m = walls[:, 1] * abs(x) / np.maximum(0.1, abs(walls[:, 0] - x))
        seen = ~beyond | (abs(walls[:, 0]) < 0.1) | (abs(at_gap_m) < 0.4)
        points = walls[seen] - (x, 0.0)
        store.put_place(node_id, Place(1.0, encode_place(points, radius_m=5.0)))


def everything(store):
    tables = ("node", "edge", "name", "area", "door", "door_edge")
    return {t: sorted(map(repr, store.query(f"SELECT * FROM {t}"))) for t in tables}  # noqa: S608


def areas(store):
    return [AreaBook(store).area_of(node.node_id) for node in store.nodes()]


EDITS = {
    "name": lambda store: edit.name_area(store, "1", "office 3"),
    "merge": lambda store: edit.merge_areas(store, "1", "area:2"),
    "split": lambda store: edit.split_area(store, "1", 1, 3),
    "kind": lambda store: edit.set_kind(store, "2", "corridor"),
    "find": find_areas,
    "delete a node with its door": lambda store: node_edit.delete_node(
        store, AreaBook(store).doors()[0].node
    ),
    "delete an edge in a door": lambda store: node_edit.delete_edge(
        store, AreaBook(store).doors()[0].edges[0]
    ),
}


@pytest.mark.parametrize("what", EDITS)
def test_an_edit_of_areas_changes_the_map_and_undo_brings_back_every_row(store, what):
    remember(store)
    before = everything(store)
    EDITS[what](store)
    assert everything(store) != before
    journal.undo(store)
    assert everything(store) == before


def test_a_merge_keeps_the_older_id_and_the_other_id_and_both_names_go_on_to_mean_it(store):
    edit.name_area(store, "1", "kitchen")
    edit.name_area(store, "2", "office 3")
    edit.merge_areas(store, "office 3", "kitchen")
    assert areas(store) == [1] * 6
    meant = [edit.resolve_area(store, text).id for text in ("1", "area:2", "kitchen", "office 3")]
    assert meant == [1, 1, 1, 1]


def test_a_split_keeps_the_name_where_most_named_nodes_are_and_uses_no_id_again(store):
    edit.name_area(store, "1", "kitchen")
    store.set_name("sink", 3)
    edit.split_area(store, "kitchen", 1, 3)
    assert areas(store) == [3, 3, 1, 2, 2, 2] or areas(store) == [3, 1, 1, 2, 2, 2]
    assert AreaBook(store).names() == {"kitchen": 1}
    journal.undo(store)
    edit.split_area(store, "kitchen", 1, 3)
    assert AreaBook(store).area_of(1) == 4


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda store: edit.name_area(store, "9", "kitchen"), "no area '9'"),
        (lambda store: edit.name_area(store, "1", "far"), "a mission means something else"),
        (lambda store: edit.name_area(store, "1", "a,b"), "a comma parts missions"),
        (lambda store: edit.name_area(store, "1", "hall"), "is the name of area 2 already"),
        (lambda store: edit.name_area(store, "1", "dock 1"), "is the name of node 4 already"),
        (lambda store: node_edit.name_node(store, 1, "hall"), "is the name of area 2 already"),
        (lambda store: edit.merge_areas(store, "1", "1"), "are one area"),
        (lambda store: edit.merge_areas(store, "1", "3"), "do not touch"),
        (lambda store: edit.split_area(store, "1", 1, 5), "node 5 is not in area 1"),
        (lambda store: edit.split_area(store, "1", 1, 1), "two different nodes"),
        (lambda store: edit.set_kind(store, "1", "attic"), "kinds are room, corridor, area"),
        (find_areas, "remember no surroundings"),
    ],
)
def test_a_wrong_edit_is_refused_in_one_line_and_nothing_is_written(store, change, told):
    edit.name_area(store, "2", "hall")
    store.set_name("dock 1", 4)
    AreaBook(store).add_area()
    before = everything(store)
    with pytest.raises(BadInput, match=told) as refusal:
        change(store)
    assert str(refusal.value).isprintable()
    assert everything(store) == before


@pytest.mark.parametrize("place", ["area:2", "office 3", "area:9"])
def test_a_reader_knows_the_nodes_of_an_area_by_number_name_and_alias(store, path, place):
    edit.name_area(store, "2", "office 3")
    AreaBook(store).put_area(AreaBook(store).area(2).__class__(2, "office 3", aliases=(9,)))
    store.commit()
    with TopoReader(path, is_checked=True) as reader:
        assert reader.area_nodes(place) == [4, 5, 6]
        assert reader.area_nodes("area:77") == reader.area_nodes("area:x") == reader.area_nodes("attic") == []


def test_the_list_of_places_tells_names_doors_and_neighbours(store):
    edit.name_area(store, "2", "office 3")
    lines = list(places(store))
    assert lines[0].startswith("area 1     -; room, level 0")
    assert "office 3" in lines[1]
    assert "next to 1" in lines[1]
    assert "between 1, 2; open" in lines[2]


def test_a_map_without_areas_says_how_to_find_them(tmp_path):
    TopoStore.create(tmp_path / "empty.lemto").close()
    assert "area find" in map_file.info_places(tmp_path / "empty.lemto")


def test_the_command_line_edits_areas(path):
    assert map_file.apply_edit(path, ["area", "name", "2", "office 3"]) == "area 2 is now 'office 3'"
    assert "area 2 is part of area 1" in map_file.apply_edit(path, ["area", "merge", "1", "office 3"])
    assert "merge area 2" in map_file.apply_edit(path, ["undo"])
    with pytest.raises(BadInput, match="needs AREA NODE NODE"):
        map_file.apply_edit(path, ["area", "split", "1"])
    with pytest.raises(BadInput, match="must be one of name, merge"):
        map_file.apply_edit(path, ["area", "paint", "1"])


def test_areas_are_found_in_an_older_map_from_what_its_nodes_remember(tmp_path):
    walk = Walk(tmp_path / "old.lemto")
    remember(walk.store)
    walk.store.close()
    with closing(sqlite3.connect(path := tmp_path / "old.lemto")) as db, db:
        for table in ("door", "door_edge", "area"):
            db.execute(f"DROP TABLE IF EXISTS {table}")
        db.execute("UPDATE node SET area = 1")
        db.execute("PRAGMA user_version = 2")
    with TopoStore.view(path) as store:
        assert AreaBook(store).areas() == []
    assert map_file.apply_edit(path, ["area", "find"]) == "2 areas, 1 doors"
    with TopoStore.view(path) as store:
        assert areas(store) == [1, 1, 1, 2, 2, 2]
    with closing(sqlite3.connect(path)) as db:
        assert db.execute("PRAGMA user_version").fetchone() == (3,)


@pytest.mark.parametrize("tags", ['"x"', '{"aliases": ["x"]}', "[1]"])
def test_an_area_with_tags_that_no_map_of_ours_has_is_refused_in_one_line(store, tags):
    store.write("UPDATE area SET tags = ? WHERE id = 1", (tags,))
    with pytest.raises(BadMap, match="area 1: its kind or tags are not ours"):
        AreaBook(store).areas()


def test_indoor_tags_hold_each_area_as_a_closed_ring_and_each_door_where_it_is(store, tmp_path):
    edit.name_area(store, "2", "office 3")
    export.write_indoor(store, tmp_path / "a.indoor.geojson")
    features = json.loads((tmp_path / "a.indoor.geojson").read_text())["features"]
    room, office, door = (each["properties"] for each in features)
    assert (room["indoor"], room["level"], office["name"]) == ("room", "0", "office 3")
    assert (door["door"], door["areas"], door["width"]) == ("yes", [1, 2], "0.90")
    for each in features[:2]:
        for (ring,) in each["geometry"]["coordinates"]:
            assert ring[0] == ring[-1]
            area = sum(a[0] * b[1] - a[1] * b[0] for a, b in pairwise(ring)) / 2.0
            assert area > 0.4  # anticlockwise, and floor within


def test_indoor_gml_joins_two_states_by_the_door_and_leaves_out_what_is_closed(store, tmp_path):
    target = tmp_path / "a.gml"
    export.write_indoorgml(store, target)
    core = "{http://www.opengis.net/indoorgml/1.0/core}"
    tree = ET.parse(target)  # noqa: S314 - our own file
    assert len(tree.findall(f".//{core}CellSpace")) == len(tree.findall(f".//{core}State")) == 2
    assert len(tree.findall(f".//{core}Transition")) == 1
    node_edit.block_edge(store, AreaBook(store).doors()[0].edges[0])
    export.write_indoorgml(store, target)
    assert ET.parse(target).findall(f".//{core}Transition") == []  # noqa: S314


def test_the_route_graph_tells_area_and_door_in_its_metadata(store, tmp_path):
    edit.name_area(store, "2", "office 3")
    export.write_route(store, tmp_path / "a.geojson")
    features = json.loads((tmp_path / "a.geojson").read_text())["features"]
    marks = {f["properties"]["id"]: f["properties"]["metadata"] for f in features[:6]}
    assert (marks[1]["area"], marks[6]["area"], marks[6]["area_name"]) == (1, 2, "office 3")
    through = [f["properties"] for f in features[6:] if "door" in f["properties"]["metadata"]]
    assert {(f["startid"], f["endid"]) for f in through} == {(3, 4), (4, 3)}


@pytest.mark.parametrize("suffix", [".png", ".indoor.geojson", ".gml", ".geojson"])
def test_every_export_of_a_map_with_areas_is_written_by_its_suffix(path, tmp_path, suffix):
    told = map_file.export_map(path, tmp_path / f"a{suffix}")
    assert (tmp_path / f"a{suffix}").stat().st_size > 500
    assert told.startswith(f"{tmp_path / f'a{suffix}'} written")


def test_an_export_of_areas_from_a_map_without_them_is_refused(tmp_path):
    TopoStore.create(tmp_path / "empty.lemto").close()
    with pytest.raises(BadInput, match="no areas to write"):
        map_file.export_map(tmp_path / "empty.lemto", tmp_path / "a.gml")
    assert not (tmp_path / "a.gml").exists()


def test_a_deleted_node_leaves_its_door_with_a_neighbour_at_the_same_place(store):
    (door,) = AreaBook(store).doors()
    before = XS[door.node - 1] + door.x_m
    store.delete_node(door.node)
    (moved,) = AreaBook(store).doors()
    assert moved.node != door.node
    assert XS[moved.node - 1] + moved.x_m == pytest.approx(before)
