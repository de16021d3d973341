import os
import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lemtomap.errors import BadMap
from lemtomap.nav.config import RouteConfig
from lemtomap.nav.route.network import RouteNetwork
from lemtomap.topo.file.reader import TopoReader
from lemtomap.topo.file.rows import edge_from, edge_row
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import FOR_EVER_S, Edge, Place
from lemtomap.types import EdgeType

A_PLACE = Place(0.0, b"\x02\x32" + bytes(198), bytes(20))  # of the format, 50 cells to each side


def an_edge(a, b, x=1.0, **changes):
    values = {"edge_id": 0, "source_id": a, "target_id": b, "T_source_target": np.array([x, 0.2, 0.3])}
    values |= {"covariance": np.diag([1e-3, 2e-3, 3e-4]), "type": EdgeType.ODOMETRY}
    return Edge(**(values | changes))


def test_what_is_written_is_read_again_and_the_file_is_one(tmp_path):
    path = tmp_path / "a.lemto"
    with TopoStore.create(path) as store:
        a, b = store.add_node(level=2, created_s=5.0), store.add_node()
        edge = store.add_edge(an_edge(a.node_id, b.node_id, time_s=4.5, share=0.4))
        store.put_place(a.node_id, Place(7.0, b"\x02\x32boundary", b"descriptor"))
        store.set_name("kitchen", b.node_id)
    assert [p.name for p in tmp_path.iterdir()] == ["a.lemto"]
    with TopoStore.open(path) as store:
        assert store.node(a.node_id) == a
        again = store.edge(edge.edge_id)
        np.testing.assert_array_equal(again.T_source_target, edge.T_source_target)
        np.testing.assert_allclose(again.covariance, edge.covariance, rtol=2e-3)
        assert (again.time_s, round(again.share, 2), again.type) == (4.5, 0.4, EdgeType.ODOMETRY)
        assert store.place(a.node_id) == Place(7.0, b"\x02\x32boundary", b"descriptor")
        assert store.names() == {"kitchen": b.node_id}


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(-3.0, 1.0), min_size=3, max_size=3), st.floats(0.05, 1.0), st.floats(-20.0, 20.0))
def test_a_covariance_comes_back_to_a_thousandth_and_positive_definite(logs, thin, lever_m):
    sigma = np.diag(10.0 ** np.array(logs))
    lever = np.eye(3)
    lever[0, 2] = lever_m  # of a chain of edges: position and heading go together
    covariance = lever @ sigma @ np.diag([1.0, thin, 1.0]) @ sigma @ lever.T
    again = edge_from(edge_row(an_edge(1, 2, covariance=covariance))).covariance
    assert np.linalg.eigvalsh(again)[0] > 0.0
    scale = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(again / np.outer(scale, scale), covariance / np.outer(scale, scale), atol=2e-3)


def test_a_closed_map_holds_only_its_rows_and_is_whole_again_when_opened(tmp_path):
    path = tmp_path / "a.lemto"
    with TopoStore.create(path) as store:
        for k in range(40):
            store.put_place(store.add_node(created_s=float(k)).node_id, A_PLACE)
            if k:
                store.add_edge(an_edge(k, k + 1))
    assert path.stat().st_size <= 40 * 500
    with TopoReader(path) as reader:
        assert [edge.other_id for edge in reader.edges_of(7)] == [8, 6]
        assert reader.openings() == []
    with TopoStore.view(path) as store:
        assert store.names() == {}
    with TopoStore.open(path) as store:
        plan = str(list(store.query("EXPLAIN QUERY PLAN SELECT id FROM edge WHERE source = 3")))
        assert "edge_source" in plan
        store.set_name("kitchen", 3)
    with TopoStore.open(path) as store:
        assert store.names() == {"kitchen": 3}


RIVAL = """
import sys
from pathlib import Path
from lemtomap.errors import BadMap
from lemtomap.robot.cli.map_file import apply_edit, info
path = Path(sys.argv[1])
print(info(path).splitlines()[0])
try:
    print(apply_edit(path, ["name", "1", "kitchen"]))
except BadMap as error:
    print(error)
"""


def test_while_a_robot_maps_others_may_look_but_not_edit(tmp_path):
    path = tmp_path / "a.lemto"

    def rival():
        command = [sys.executable, "-c", RIVAL, str(path)]
        root = Path(__file__).parents[3]
        return subprocess.run(command, capture_output=True, text=True, cwd=root, check=True).stdout  # noqa: S603

    with TopoStore.create(path) as store:
        store.add_node()
        store.commit()
        TopoReader(path).close()  # must not let go of the locks that the store holds
        store.add_node()
        store.commit()
        looked, refused = rival().splitlines()
        assert looked.split() == ["nodes", "2"]
        assert refused.startswith(f"{path}: in use by another program")
        store.add_node()
    assert "is now 'kitchen'" in rival()
    with TopoStore.open(path) as store:
        assert store.count("node") == 3


def test_what_is_left_of_a_block_outlasts_a_restart_of_the_clock(tmp_path):
    path = tmp_path / "a.lemto"
    with TopoStore.create(path) as store:
        store.add_node()
        for k in range(1, 4):
            store.add_node()
            store.add_edge(an_edge(k, k + 1))
        store.tick(5000.0)
        for edge_id, until_s in ((1, 5060.0), (2, 5010.0), (3, FOR_EVER_S)):
            store.put_edge(replace(store.edge(edge_id), blocked_until_s=until_s))
        store.tick(5020.0)
    with TopoStore.open(path) as store:
        store.tick(7.0)
        assert [edge.blocked_until_s for edge in store.edges()] == [7.0 + 40.0, 0.0, FOR_EVER_S]
        store.tick(8.0)
    with TopoStore.open(path) as store:
        store.tick(1.0)
        assert store.edge(1).blocked_until_s == pytest.approx(1.0 + 39.0)


def test_ids_are_never_used_again(tmp_path):
    with TopoStore.create(tmp_path / "a.lemto") as store:
        nodes = [store.add_node().node_id for _ in range(3)]
        edge = store.add_edge(an_edge(nodes[1], nodes[2]))
        store.delete_node(nodes[2])
        assert store.edge(edge.edge_id) is None
    with TopoStore.open(tmp_path / "a.lemto") as store:
        assert store.add_node().node_id > nodes[2]
        assert store.add_edge(an_edge(1, 2)).edge_id > edge.edge_id


def damage(path, how):
    if how == "empty":
        path.write_bytes(b"")
    elif how == "foreign":
        path.write_bytes(b"\x89PNG" + bytes(2000))
    elif how == "other sqlite":
        path.unlink()
        db = sqlite3.connect(path)
        db.execute("CREATE TABLE t(a)")
        db.commit()
        db.close()
    elif how == "newer":
        db = sqlite3.connect(path)
        db.execute("PRAGMA user_version = 99")
        db.commit()
        db.close()
    elif how == "cut in header":
        path.write_bytes(path.read_bytes()[:60])
    elif how == "cut":
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2 + 100])
    elif how == "overwritten":
        data = bytearray(path.read_bytes())
        data[1024 : len(data) - 1024] = os.urandom(len(data) - 2048)
        path.write_bytes(data)


@pytest.mark.parametrize(
    "how", ["empty", "foreign", "other sqlite", "newer", "cut in header", "cut", "overwritten"]
)
def test_a_file_that_is_no_whole_map_is_refused_in_one_line_and_left_as_it_is(tmp_path, how):
    path = tmp_path / "a.lemto"
    with TopoStore.create(path) as store:
        for _ in range(200):
            store.add_node()
    damage(path, how)
    before = path.read_bytes()
    for open_it in (TopoStore.open, TopoReader):
        with pytest.raises(BadMap, match=r"a\.lemto: ") as refusal:
            open_it(path).edges_of(1)
        assert "\n" not in str(refusal.value)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.lemto"]


def test_missing_present_and_unwritable_paths_are_named(tmp_path):
    with pytest.raises(BadMap, match="no such map file"):
        TopoStore.open(tmp_path / "none.lemto")
    TopoStore.create(tmp_path / "a.lemto").close()
    with pytest.raises(BadMap, match="exists already"):
        TopoStore.create(tmp_path / "a.lemto")
    with pytest.raises(BadMap, match="cannot be created"):
        TopoStore.create(tmp_path / "no" / "folder" / "a.lemto")
    with pytest.raises(BadMap, match="is a folder"):
        TopoStore.open(tmp_path)


def fill(store):
    for _ in range(1000):
        store.put_place(store.add_node().node_id, Place(0.0, b"\x02\x32" + bytes(498)))


def test_a_full_disk_is_one_clear_line_and_the_committed_map_stays(tmp_path):
    path = tmp_path / "a.lemto"
    store = TopoStore.create(path)
    store.add_node()
    store.commit()
    store._db.execute("PRAGMA max_page_count = 20")
    with pytest.raises(BadMap, match="disk is full"):
        fill(store)
    store._db.close()
    with TopoStore.open(path) as again:
        assert again.node(1) is not None


FILLER = """
import resource, sys
from pathlib import Path
from lemtomap.errors import BadMap
from lemtomap.topo.graph import Place
from lemtomap.topo.file.store import TopoStore
store = TopoStore.create(Path(sys.argv[1]), commit_every_s=0.0)
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
try:
    for k in range(3000):
        store.put_place(store.add_node(created_s=float(k)).node_id, Place(float(k), b"\x02\x32" + bytes(498)))
        store.commit()
        print(k, flush=True)
except BadMap as error:
    print(error)
"""


def test_no_room_for_a_growing_file_is_one_clear_line_and_every_commit_stays(tmp_path):
    path = tmp_path / "a.lemto"
    command = [sys.executable, "-c", FILLER, str(path)]
    root = Path(__file__).parents[3]
    said = subprocess.run(command, capture_output=True, text=True, cwd=root, check=False).stdout  # noqa: S603
    *written, refusal = said.splitlines()
    assert refusal.startswith(f"{path}: the disk ")
    with TopoStore.open(path) as store:
        assert store.count("node") >= int(written[-1]) + 1 >= 20


def test_a_reader_follows_the_writer_and_forgets_only_what_changed(tmp_path):
    path = tmp_path / "a.lemto"
    with TopoStore.create(path) as store:
        for _ in range(4):
            store.add_node()
        first = store.add_edge(an_edge(1, 2))
        store.add_edge(an_edge(3, 4))
        store.commit()
        with TopoReader(path) as reader:
            version = reader.version
            kept = reader.edges_of(3)
            assert [edge.other_id for edge in reader.edges_of(1)] == [2]
            assert reader.edges_of(99) == ()
            assert not reader.has_node(99)
            store.put_edge(an_edge(1, 2, edge_id=first.edge_id, blocked_until_s=30.0))
            assert reader.version == version  # not committed yet
            store.commit()
            assert reader.version != version
            assert reader.edges_of(2)[0].blocked_until_s == 30.0
            assert reader.edges_of(3) is kept


def test_an_undriven_closure_is_no_short_cut_until_someone_has_driven_it(tmp_path):
    """A closure may pass through a wall: it is dearer than a way of many times its length that is known."""
    path = tmp_path / "a.lemto"
    with TopoStore.create(path) as store:
        for _ in range(16):
            store.add_node()
        for a in (1, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15):
            store.add_edge(an_edge(a, 5 if a == 1 else a + 1))
        store.add_edge(an_edge(16, 4))
        closure = store.add_edge(an_edge(1, 4, type=EdgeType.LOOP_CLOSING))
        store.commit()
        with TopoReader(path) as reader:
            network = RouteNetwork(reader.edge_table(), RouteConfig())
            assert network.plan(1, 4, 0.0).nodes == (1, *range(5, 17), 4)
            assert [edge.proven for edge in reader.edges_of(1)] == [True, False]
            assert max(edge.time_s for edge in reader.edges_of(1)) == closure.expected_time_s
            store.put_edge(replace(closure, time_s=2.5))
            store.commit()
            network = RouteNetwork(reader.edge_table(), RouteConfig())
            assert network.plan(1, 4, 0.0).nodes == (1, 4)
            assert network.plan(1, 4, 0.0).edges[0].proven


WRITER = """
import sys
from pathlib import Path
from lemtomap.topo.file.store import TopoStore
store = TopoStore.open(Path(sys.argv[1]))
for k in range(10**9):
    now = k * 0.01
    node = store.add_node(created_s=now)
    store.tick(now)
    print(now, flush=True)
"""


def test_killed_at_any_moment_the_map_opens_and_lost_at_most_a_second(tmp_path):
    path = tmp_path / "a.lemto"
    TopoStore.create(path).close()
    rng = np.random.default_rng(3)
    for _ in range(5):
        writer = subprocess.Popen(  # noqa: S603 - our own program
            [sys.executable, "-c", WRITER, str(path)],
            stdout=subprocess.PIPE,
            text=True,
            cwd=Path(__file__).parents[3],
        )
        assert writer.stdout is not None
        first = writer.stdout.readline()
        time.sleep(float(rng.uniform(0.0, 0.5)))
        os.kill(writer.pid, signal.SIGKILL)
        said_s = float((first + writer.stdout.read()).split("\n")[-2])
        writer.wait()
        writer.stdout.close()
        with TopoStore.open(path) as store:
            assert max((node.created_s for node in store.nodes()), default=0.0) >= said_s - 1.0
            store.write("UPDATE node SET created = 0.0")
