import json
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import yaml

from lemtomap.errors import BadInput
from lemtomap.se2 import between, wrap_angle
from lemtomap.topo import edit, export
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.graph import Edge, Place
from lemtomap.topo.info import describe_map
from lemtomap.topo.journal import entries
from lemtomap.topo.layout import lay_out, trajectory
from lemtomap.topo.mapper import TopoMapper
from lemtomap.topo.picture import write_png
from lemtomap.topo.reader import TopoReader
from lemtomap.topo.store import TopoStore
from lemtomap.types import EdgeType
from tests.lemtomap.topo.drive import lead, room
from tests.lemtomap.topo.test_solve import read_g2o


@pytest.fixture
def store(tmp_path):
    """A loop of some fifteen nodes with near-neighbour edges, one name and one place."""
    mapper = TopoMapper(TopoConfig(), TopoStore.create(tmp_path / "office.lemto"))
    lead(mapper, [(-2, -2), (2, -2), (2, 2), (-2, 2), (-2, -1.0)], room())
    mapper.close()
    with TopoStore.open(tmp_path / "office.lemto") as store:
        store.set_name("kitchen", 3)
        store.put_place(3, Place(1.0, b"boundary", b"\x00\xff"))
        store.put_ground(3, b"picture")
        yield store


def everything(store):
    tables = ("node", "place", "edge", "name", "area", "placeholder", "ground", "mark")
    return {t: sorted(map(repr, store.query(f"SELECT * FROM {t}"))) for t in tables}  # noqa: S608


EDITS = {
    "name": lambda store: edit.name_node(store, 5, "lab"),
    "rename": lambda store: edit.name_node(store, 3, "lab"),
    "move name": lambda store: edit.name_node(store, 5, "kitchen"),
    "unname": lambda store: edit.unname(store, "kitchen"),
    "delete node": lambda store: edit.delete_node(store, 3),
    "delete edge": lambda store: edit.delete_edge(store, 2),
    "block": lambda store: edit.block_edge(store, 2, 50.0),
    "level": lambda store: edit.set_level(store, 3, 1),
}


@pytest.mark.parametrize("what", EDITS)
def test_an_edit_changes_the_map_and_undo_brings_back_every_row(store, what):
    before = everything(store)
    EDITS[what](store)
    assert everything(store) != before
    newest = entries(store)[0]
    assert edit.undo(store) == newest.what
    assert everything(store) == before


def test_edits_are_undone_newest_first_also_after_reopening(store):
    states = [everything(store)]
    for do in EDITS.values():
        try:
            do(store)
        except BadInput:  # an earlier edit took away what this one wants
            continue
        states.append(everything(store))
    store.close()
    with TopoStore.open(store.path) as again:
        for state in reversed(states[:-1]):
            assert edit.undo(again) is not None
            assert everything(again) == state
        assert edit.undo(again) is None


def test_edits_of_what_is_not_there_are_refused_and_leave_no_trace(store):
    before = everything(store)
    for wrong in (
        lambda: edit.delete_node(store, 999),
        lambda: edit.delete_edge(store, 999),
        lambda: edit.unname(store, "cellar"),
        lambda: edit.name_node(store, 1, "12"),
        lambda: edit.resolve_node(store, "cellar"),
    ):
        with pytest.raises(BadInput, match=r"999|cellar|12"):
            wrong()
    assert everything(store) == before
    assert entries(store) == []


def test_a_reader_sees_a_blocked_edge_and_its_undoing(store):
    store.commit()
    with TopoReader(store.path) as reader:
        assert reader.version >= 0
        edge_id = reader.edges_of(2)[0].edge_id
        for do, until_s in (
            (lambda: edit.block_edge(store, edge_id, 50.0), 50.0),
            (lambda: edit.undo(store), 0.0),
        ):
            version = reader.version
            do()
            store.commit()
            assert reader.version != version
            assert reader.edges_of(2)[0].blocked_until_s == until_s


def test_the_layout_agrees_with_all_edges_and_the_trajectory_with_the_drive(tmp_path):
    mapper = TopoMapper(TopoConfig(), TopoStore.create(tmp_path / "map.lemto"))
    lead(mapper, [(-2, -2), (2, -2), (2, 2), (-2, 2), (-2, -1.0)], room())
    layout = lay_out(mapper.store)
    for edge in mapper.store.edges():
        seen = between(layout.T_map_node[edge.source_id], layout.T_map_node[edge.target_id])
        np.testing.assert_allclose(seen, edge.T_source_target, atol=1e-6)
    stamps, poses = trajectory(layout, mapper.trail)
    assert len(stamps) == 150
    np.testing.assert_allclose(between(poses[0], poses[40])[:2], [4.0, 0.0], atol=1e-6)
    mapper.close()


def test_parts_that_were_never_joined_are_laid_side_by_side(tmp_path):
    with TopoStore.create(tmp_path / "map.lemto") as store:
        for _ in range(4):
            store.add_node()
        for a in (1, 3):
            store.add_edge(Edge(0, a, a + 1, np.array([2.0, 0, 0]), np.eye(3) * 1e-3, EdgeType.ODOMETRY))
        layout = lay_out(store)
    assert len(set(layout.component.values())) == 2
    assert layout.T_map_node[3][0] >= layout.T_map_node[2][0] + 10.0 - 1e-9


def test_geojson_is_what_nav2s_loader_wants(store, tmp_path):
    export.write_geojson(store, tmp_path / "map.geojson")
    features = json.loads((tmp_path / "map.geojson").read_text())["features"]
    points = [f for f in features if f["geometry"]["type"] == "Point"]
    lines = [f for f in features if f["geometry"]["type"] == "MultiLineString"]
    assert len(points) == store.count("node")
    assert len(lines) == 2 * store.count("edge")
    numbers = [f["properties"]["id"] for f in features]
    assert len(set(numbers)) == len(numbers)
    ids = {p["properties"]["id"] for p in points}
    ways = {(f["properties"]["startid"], f["properties"]["endid"]) for f in lines}
    assert all(a in ids and b in ids and (b, a) in ways for a, b in ways)
    assert any(p["properties"]["metadata"].get("name") == "kitchen" for p in points)


def test_tmap2_names_every_destination(store, tmp_path):
    export.write_tmap2(store, tmp_path / "map.tmap2")
    nodes = [n["node"] for n in yaml.safe_load((tmp_path / "map.tmap2").read_text())["nodes"]]
    names = {node["name"] for node in nodes}
    assert "kitchen" in names
    for node in nodes:
        assert len(node["verts"]) == 8
        assert {edge["node"] for edge in node["edges"]} <= names
        assert all(edge["edge_id"] == f"{node['name']}_{edge['node']}" for edge in node["edges"])


def test_g2o_reads_back_as_the_same_graph(store, tmp_path):
    export.write_g2o(store, tmp_path / "map.g2o")
    poses, problem = read_g2o(tmp_path / "map.g2o")
    edges = list(store.edges())
    assert len(poses) == store.count("node")
    np.testing.assert_allclose(problem.measured, [e.T_source_target for e in edges], atol=1e-9)
    assert problem.chi2(poses) < 1e-6
    turns = wrap_angle(
        between(poses[problem.ends[:, 0]], poses[problem.ends[:, 1]])[:, 2] - problem.measured[:, 2]
    )
    assert np.abs(turns).max() < 1e-6


def test_graphml_is_whole(store, tmp_path):
    export.write_graphml(store, tmp_path / "map.graphml")
    tree = ET.parse(tmp_path / "map.graphml").getroot()  # noqa: S314 - just written
    tags = [element.tag.rsplit("}")[-1] for element in tree.iter()]
    assert tags.count("node") == store.count("node")
    assert tags.count("edge") == store.count("edge")


def test_a_picture_is_drawn(store, tmp_path):
    write_png(store, tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


def test_exports_that_cannot_be_are_refused_in_one_line(tmp_path, store):
    with TopoStore.create(tmp_path / "one.lemto") as one:
        one.add_node()
        for suffix in (".geojson", ".tmap2"):
            with pytest.raises(BadInput, match="without edges"):
                export.WRITERS[suffix](one, tmp_path / f"one{suffix}")
    with pytest.raises(BadInput, match="cannot be written"):
        export.write_g2o(store, tmp_path / "none" / "map.g2o")
    assert not list(tmp_path.glob("*.part"))


def test_info_counts_what_is_there(store):
    info = describe_map(store)
    assert info.nodes == store.count("node")
    assert sum(info.edges.values()) == store.count("edge")
    assert (info.components, info.names, info.levels) == (1, {"kitchen": 3}, {0: info.nodes})
    edit.delete_node(store, 3)
    assert describe_map(store).undoable == 1
