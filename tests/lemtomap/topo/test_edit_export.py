import json
import xml.etree.ElementTree as ET
from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
import yaml

from lemtomap.errors import BadInput
from lemtomap.se2 import between, wrap_angle
from lemtomap.topo import naming
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file import edit
from lemtomap.topo.file.info import describe_map
from lemtomap.topo.file.journal import entries
from lemtomap.topo.file.reader import TopoReader
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge, Place
from lemtomap.topo.mapper import TopoMapper
from lemtomap.topo.whole import export, picture
from lemtomap.topo.whole.layout import lay_out, trajectory
from lemtomap.topo.whole.picture import write_png
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
        store.put_place(3, Place(1.0, b"\x02\x32boundary", b"\x00\xff"))
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


def test_gtsam_reads_the_pose_graph_whole(store, tmp_path):
    gtsam = pytest.importorskip("gtsam")
    edit.block_edge(store, 2)
    assert any(edge.share == 0.0 for edge in store.edges())
    export.write_g2o(store, tmp_path / "map.g2o")
    graph, values = gtsam.readG2o(str(tmp_path / "map.g2o"), False)
    assert graph.size() == store.count("edge") - 1
    assert values.size() == store.count("node")
    assert graph.error(values) < 1e-3


@pytest.fixture
def walled(store):
    """The ways that must not be driven: 1-2 is closed by hand; nobody has driven the closure 1-9."""
    between_them = next(e for e in store.edges_of(1) if e.other(1) == 2)
    edit.block_edge(store, between_them.edge_id)
    closure = replace(between_them, source_id=1, target_id=9, type=EdgeType.LOOP_CLOSING, time_s=None)
    assert store.add_edge(replace(closure, T_source_target=_apart(store, 1, 9))).edge_id
    driven = replace(closure, source_id=2, target_id=9, time_s=3.0)
    store.add_edge(replace(driven, T_source_target=_apart(store, 2, 9)))
    return store


def _apart(store, a, b):
    at = lay_out(store).T_map_node
    return between(at[a], at[b])


FORBIDDEN, DRIVEN = [{1, 2}, {1, 9}], {2, 9}


def test_no_way_goes_along_what_is_closed_or_what_nobody_has_driven(walled, tmp_path):
    export.write_geojson(walled, tmp_path / "map.geojson")
    features = json.loads((tmp_path / "map.geojson").read_text())["features"]
    ends = [f["properties"] for f in features if "startid" in f["properties"]]
    ways = [{end["startid"], end["endid"]} for end in ends]
    assert not any(way in ways for way in FORBIDDEN)
    assert ways.count(DRIVEN) == 2
    export.write_tmap2(walled, tmp_path / "map.tmap2")
    nodes = yaml.safe_load((tmp_path / "map.tmap2").read_text())["nodes"]
    ways = [{node["node"]["name"], edge["node"]} for node in nodes for edge in node["node"]["edges"]]
    assert not any({f"Node{a}", f"Node{b}"} in ways for a, b in FORBIDDEN)
    assert {"Node2", "Node9"} in ways
    assert export.left_out(walled) == (1, 1)


def test_other_formats_mark_or_leave_out_what_is_closed(walled, tmp_path):
    export.write_graphml(walled, tmp_path / "map.graphml")
    graph = nx.read_graphml(tmp_path / "map.graphml")
    marks = {frozenset((int(a), int(b))): (w["closed"], w["proven"]) for a, b, w in graph.edges(data=True)}
    assert marks[frozenset((1, 2))][0] is True
    assert marks[frozenset((1, 9))] == (False, False)
    assert marks[frozenset(DRIVEN)] == (False, True)
    export.write_g2o(walled, tmp_path / "map.g2o")
    rows = [line.split() for line in (tmp_path / "map.g2o").read_text().splitlines()]
    measured = [{int(row[1]), int(row[2])} for row in rows if row[0] == "EDGE_SE2"]
    assert {1, 2} not in measured
    assert {1, 9} in measured  # a closure is a measurement, whoever drives there
    figure = picture._drawn(walled)
    legend = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert "closed by hand (1)" in legend
    assert "loop closing, not driven yet (1)" in legend


def test_a_map_all_of_whose_ways_are_closed_is_refused_where_only_ways_count(tmp_path):
    with TopoStore.create(tmp_path / "map.lemto") as store:
        for _ in range(2):
            store.add_node()
        edge = Edge(0, 1, 2, np.array([2.0, 0, 0]), np.eye(3) * 1e-3, EdgeType.LOOP_CLOSING)
        store.add_edge(edge)
        for suffix in (".geojson", ".tmap2"):
            with pytest.raises(BadInput, match="without an open way"):
                export.WRITERS[suffix](store, tmp_path / f"map{suffix}")


def test_closing_a_way_closes_every_edge_of_it_and_undo_opens_them(store):
    first = next(e for e in store.edges_of(1) if e.other(1) == 2)
    store.add_edge(replace(first, type=EdgeType.LOOP_CLOSING))
    edit.block_between(store, 2, 1)
    both = [e.edge_id for e in store.edges_of(1) if e.other(1) == 2]
    assert [store.edge(edge_id).is_closed for edge_id in both] == [True, True]
    edit.undo(store)
    assert [store.edge(edge_id).is_closed for edge_id in both] == [False, False]


ODD_NAMES = {
    r"lab $\foo$": r"lab $\foo$",
    "a\x00b\x1b[31m\ufffe": r"a\x00b\x1b[31m\ufffe",
    "\u53a8\u623f \U0001f373": "\u53a8\u623f \U0001f373",
    "<&\"'>]]>": "<&\"'>]]>",
    "Node7": "Node7",
    "long" * 1300: "long" * 19 + "lon\u2026",
    "\ud7ff, {}: #": "\ud7ff, {}: #",
}


@pytest.mark.parametrize("name", ODD_NAMES, ids=range(len(ODD_NAMES)))
def test_whatever_name_an_old_map_holds_every_export_of_it_can_be_read(store, tmp_path, name):
    store.set_name(name, 4)
    told = ODD_NAMES[name] if ODD_NAMES[name].isprintable() else naming.shown(name)
    for suffix, write in export.WRITERS.items():
        write(store, tmp_path / f"$x_{{map{suffix}")
    features = json.loads((tmp_path / "$x_{map.geojson").read_text())["features"]
    assert told in [f["properties"]["metadata"].get("name") for f in features]
    nodes = yaml.safe_load((tmp_path / "$x_{map.tmap2").read_text())["nodes"]
    names = [node["node"]["name"] for node in nodes]
    assert told in names
    assert len(set(names)) == len(names)
    assert told in nx.get_node_attributes(nx.read_graphml(tmp_path / "$x_{map.graphml"), "name").values()
    write_png(store, tmp_path / "$x_{map.png")
    assert (tmp_path / "$x_{map.png").read_bytes().startswith(b"\x89PNG")


def test_tmap2_edges_of_alike_names_and_of_two_edges_between_two_nodes_differ(store, tmp_path):
    for node_id, name in ((1, "a"), (2, "b_c"), (4, "a_b"), (5, "c")):
        store.set_name(name, node_id)
    for a, b in ((1, 2), (1, 2), (4, 5)):
        store.add_edge(Edge(0, a, b, _apart(store, a, b), np.eye(3) * 1e-3, EdgeType.ODOMETRY))
    export.write_tmap2(store, tmp_path / "map.tmap2")
    nodes = yaml.safe_load((tmp_path / "map.tmap2").read_text())["nodes"]
    edges = [edge["edge_id"] for node in nodes for edge in node["node"]["edges"]]
    assert len(set(edges)) == len(edges)
    assert {"a_b_c", "a_b_c_2"} <= set(edges)
    to = [edge["node"] for edge in next(n for n in nodes if n["node"]["name"] == "a")["node"]["edges"]]
    assert len(set(to)) == len(to)


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
    assert not list(tmp_path.rglob(".*.part"))


@pytest.mark.parametrize("suffix", [*export.WRITERS, ".png"])
def test_an_export_that_finds_no_room_leaves_the_file_that_was_there(tmp_path, store, monkeypatch, suffix):
    target = tmp_path / f"map{suffix}"
    target.write_text("precious")

    def half(path, data):
        with path.open("wb") as file:
            file.write(data[:9])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_bytes", half)
    with pytest.raises(BadInput, match=r"cannot be written .* space left"):
        (export.WRITERS | {".png": write_png})[suffix](store, target)
    assert target.read_text() == "precious"
    assert not list(tmp_path.glob(".*"))


def test_info_counts_what_is_there(store):
    info = describe_map(store)
    assert info.nodes == store.count("node")
    assert sum(info.edges.values()) == store.count("edge")
    assert (info.components, info.names, info.levels) == (1, {"kitchen": 3}, {0: info.nodes})
    edit.delete_node(store, 3)
    assert describe_map(store).undoable == 1
