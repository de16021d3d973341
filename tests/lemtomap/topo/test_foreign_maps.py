"""Maps from strangers: whatever no map of ours holds is refused in one line, and nothing in it is run."""

import sqlite3
import struct
from contextlib import closing, suppress

import numpy as np
import pytest

from lemtomap.errors import BadMap
from lemtomap.topo.file import edit, schema
from lemtomap.topo.file.checks import COLUMNS
from lemtomap.topo.file.journal import KEYS
from lemtomap.topo.file.reader import TopoReader
from lemtomap.topo.file.rows import MEASURE, MOST_PLACE_CELLS
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import (
    Edge,
    Mark,
    Place,
    Placeholder,
)
from lemtomap.topo.loops.descriptor import BYTES, describe
from lemtomap.topo.loops.index import PlaceIndex
from lemtomap.topo.place import codec, encode_place
from lemtomap.types import EdgeType

WALL = np.column_stack([np.linspace(-2.0, 2.0, 60), np.ones(60)])


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A map with a row in every table and its look-up still in it: two nodes, an edge, a name."""
    path = tmp_path_factory.mktemp("sound") / "map.lemto"
    store = TopoStore.create(path)
    for _ in range(2):
        node = store.add_node(created_s=1.0)
        store.put_place(node.node_id, Place(1.0, encode_place(WALL), describe(WALL)))
    PlaceIndex.of_map(store).catch_up()
    store.put_place(2, Place(2.0, encode_place(WALL), describe(WALL)))
    store.add_edge(Edge(0, 1, 2, np.array([1.0, 0.2, 0.3]), np.eye(3) * 1e-3, EdgeType.ODOMETRY))
    store.write("INSERT INTO place_split VALUES(0, 3, 100, 1, 2)")
    store.write("INSERT INTO area VALUES(1, 'east', NULL, NULL)")
    store.write("INSERT INTO door VALUES(1, 2, 0.5, 0.0, 0.1, 0.9, 3, 0, 2.0, NULL, 1, 1)")
    store.write("INSERT INTO door_edge VALUES(1, 1)")
    store.add_placeholder(Placeholder(0, 2, 1.0, 2.0, 0.5, 1.0))
    store.add_mark(Mark(0, 1, "bump", 0.1, 0.2, 3.0))
    store.put_ground(1, b"picture")
    store.set_meta("next_node", 3)
    edit.name_node(store, 1, "kitchen")
    store.commit()
    copy = path.read_bytes()  # still with its write-ahead log beside it
    log = path.with_name("map.lemto-wal").read_bytes()
    store.close()
    path.write_bytes(copy)
    path.with_name("map.lemto-wal").write_bytes(log)
    with closing(sqlite3.connect(path)) as db:
        db.execute("PRAGMA journal_mode = DELETE")
    return path.read_bytes()


@pytest.fixture
def path(tmp_path, sound):
    path = tmp_path / "map.lemto"
    path.write_bytes(sound)
    return path


def harm(path, *statements):
    with closing(sqlite3.connect(path, isolation_level=None)) as db:
        for statement, *values in statements:
            db.execute(statement, values)


def assert_refused(path, reason):
    before = path.read_bytes()
    for open_it in (
        TopoStore.open,
        TopoStore.view,
        TopoReader,
        lambda path: TopoStore.editing(path).__enter__(),
    ):
        with pytest.raises(BadMap, match=reason) as refusal:
            open_it(path)
        assert str(refusal.value).startswith(f"{path}: ")
        assert str(refusal.value).isprintable()
    assert path.read_bytes() == before
    assert [each.name for each in path.parent.iterdir()] == ["map.lemto"]


def test_a_sound_map_with_everything_in_it_is_opened_by_every_reader(path):
    with closing(sqlite3.connect(path)) as db:
        kinds = {name for (name,) in db.execute("SELECT name FROM sqlite_schema")}
        assert kinds >= {*schema.TABLES, *schema.LOOK_UP_TABLES, *schema.TRIGGERS, *schema.INDEXES}
        assert all(db.execute(f"SELECT 1 FROM {table}").fetchone() for table in COLUMNS)  # noqa: S608
    TopoStore.view(path).close()
    TopoReader(path).close()
    with TopoStore.open(path) as store:
        assert store.names() == {"kitchen": 1}


FOREIGN = {
    "trigger": "CREATE TRIGGER evil AFTER UPDATE ON node BEGIN DELETE FROM edge; END",
    "trigger of our name": (
        "DROP TRIGGER place_gone",
        "CREATE TRIGGER place_gone AFTER DELETE ON place BEGIN DELETE FROM edge; END",
    ),
    "view": "CREATE VIEW nodes AS SELECT * FROM node",
    "view instead of a table": ("DROP TABLE area", "CREATE VIEW area AS SELECT id, id, id, id FROM node"),
    "table": "CREATE TABLE extra(a)",
    "column": "ALTER TABLE node ADD COLUMN extra",
    "generated column": "ALTER TABLE node ADD COLUMN extra AS (abs(id))",
    "index": "CREATE INDEX slow ON edge(measure)",
    "no table": "DROP TABLE edge",
}


@pytest.mark.parametrize("what", FOREIGN)
def test_a_schema_that_is_not_ours_is_refused(path, what):
    statements = FOREIGN[what]
    harm(path, *((each,) for each in ([statements] if isinstance(statements, str) else statements)))
    assert_refused(path, "is not ours|no table")


def a_measure(*, x=1.0, sigma=0.03, steps=(0, 0, 0)):
    return MEASURE.pack(x, 0.2, 0.3, sigma, 0.03, 0.03, *steps)


INF, NAN = float("inf"), struct.unpack("<d", b"\xff" * 8)[0]
ODD_ROWS = {
    "UPDATE edge SET measure = ?": [
        b"short",
        b"",
        None,
        "text of thirty-six letters, all told",
        a_measure()[:-1],
        a_measure(x=NAN),
        a_measure(x=INF),
        a_measure(x=1e300),
        a_measure(sigma=0.0),
        a_measure(sigma=-0.1),
        a_measure(sigma=INF),
        a_measure(steps=(32767, 0, 0)),
        a_measure(steps=(30000, 30000, -30000)),
    ],
    "UPDATE edge SET source = ?": [7, 0, -1, None, "1x", 1.5, 2**62],
    "UPDATE edge SET target = ?": [7, 1, None],  # 1: an edge from a node to itself
    "UPDATE edge SET type = ?": [3, -1, None, "loop"],
    "UPDATE edge SET share = ?": [256, -1, None],
    "UPDATE edge SET time = ?": [0.0, -1.0, INF, "soon"],
    "UPDATE edge SET blocked = ?": [INF, "yes"],
    "UPDATE edge SET id = ?": [-5, 0, 2**62],
    "UPDATE node SET id = ? WHERE id = 2": [-2, 2**62],
    "UPDATE node SET level = ?": [None, "up", 1.5, 10**6],
    "UPDATE node SET created = ?": [INF, None, b"x"],
    "UPDATE node SET visits = ?": [-1, None],
    "UPDATE node SET area = ?": ["hall"],
    "UPDATE name SET node = ?": [9, None, "kitchen"],
    "UPDATE name SET name = ?": [b"kitchen", "x" * 1_100_000],
    "UPDATE place SET boundary = ?": [
        b"",
        b"\x01\x10",
        b"\x02\x00",
        b"\x02\xff",
        None,
        "text",
        b"\x02\x10" * 40_000,
    ],
    "UPDATE place SET descriptor = ?": ["text", bytes(70_000)],
    "UPDATE place SET node = ? WHERE node = 2": [9],
    "UPDATE placeholder SET state = ?": ["ajar", None, 1],
    "UPDATE placeholder SET x = ?": [INF, None, "left"],
    "UPDATE mark SET kind = ?": [None, b"bump"],
    "UPDATE ground SET picture = ?": [None, bytes(70_000)],
    "UPDATE journal SET before = ?": [None, b"[]"],
    "UPDATE meta SET value = ? WHERE key = 'next_node'": ["three", None, -4, 2.5],
    "UPDATE place_split SET low = ?": [0, -1, None],  # 0: a way round in the tree
    "UPDATE place_split SET high = ?": [1, None],
    "UPDATE place_split SET id = ?": [10**9],  # room for so many would be made
    "UPDATE place_split SET axis = ?": [20, -1],
    "UPDATE place_leaf SET entries = ?": [None, "text"],
}


@pytest.mark.parametrize(("statement", "value"), [(s, v) for s, values in ODD_ROWS.items() for v in values])
def test_a_row_that_no_map_of_ours_holds_is_refused(path, statement, value):
    harm(path, (statement, value))
    table = statement.split()[1]
    assert_refused(path, rf"{table} \S+: ")


def test_a_schema_that_is_no_text_is_refused(path):
    data = path.read_bytes()
    data = data.replace(b"tablenodenode", b"tablen\x9cdenode")  # which SQLite quotes, for it ...
    path.write_bytes(data.replace(b"CREATE TABLE node(id", b"XREATE TABLE node(id"))  # ... cannot read this
    assert_refused(path, "damaged|not a .lemto map")


def test_a_value_too_large_to_be_ours_is_refused(path):
    harm(path, ("UPDATE journal SET what = ?", "x" * (schema.MOST_VALUE_BYTES + 1)))
    with pytest.raises(BadMap, match="damaged"):
        TopoStore.view(path)


JOURNALS = [
    "no json",
    "{}",
    "[1]",
    "[[1, 2, 3]]",
    '[["change; DELETE FROM node", 1, null]]',
    '[["node", 1, {"id": 1}]]',
    '[["node", 1, {"id, area) SELECT 1, 1 --": 1}]]',
    '[["node", {"bytes": 3}, null]]',
    '[["node", 1, null]]',  # its edge would hang in the air
    '[["name", "lab", {"name": "lab", "node": 99}]]',
    '[["place", 1, {"node": 1, "taken": 1.0, "boundary": {"bytes": "%%%"}, "descriptor": null}]]',
    "[" * 30_000,
]


@pytest.mark.parametrize("before", JOURNALS, ids=range(len(JOURNALS)))
def test_a_journal_that_no_edit_wrote_is_not_taken_back_and_nothing_changes(path, before):
    harm(path, ("UPDATE journal SET before = ?", before))
    kept = path.read_bytes()
    with pytest.raises(BadMap, match="cannot be taken back"), TopoStore.editing(path) as store:
        edit.undo(store)
    assert path.read_bytes() == kept
    with TopoStore.open(path) as store:  # nor when the robot holds the map open
        rows = {table: list(store.query(f"SELECT * FROM {table}")) for table in KEYS}  # noqa: S608
        with pytest.raises(BadMap):
            edit.undo(store)
        assert {table: list(store.query(f"SELECT * FROM {table}")) for table in KEYS} == rows  # noqa: S608


def test_every_connection_distrusts_the_file(path):
    for connect in (schema.connect, schema.connect_readonly):
        with closing(connect(path)) as db:
            assert db.execute("PRAGMA trusted_schema").fetchone() == (0,)
            assert db.execute("PRAGMA cell_size_check").fetchone() == (1,)
            assert db.getlimit(sqlite3.SQLITE_LIMIT_LENGTH) == schema.MOST_VALUE_BYTES
            with pytest.raises(sqlite3.OperationalError):
                db.execute("SELECT load_extension('x')")


def test_an_edit_that_fails_half_way_leaves_nothing(path):
    kept = path.read_bytes()

    def fail(store):
        with store.whole():
            store.set_name("lab", 2)
            raise ValueError

    with suppress(ValueError), TopoStore.editing(path) as store:
        store.set_name("hall", 2)
        raise ValueError
    assert path.read_bytes() == kept
    with TopoStore.open(path) as store:
        store.set_name("hall", 2)
        with suppress(ValueError):
            fail(store)
        assert store.names() == {"kitchen": 1, "hall": 2}


def test_what_the_file_knows_of_codes_is_what_their_makers_make():
    assert schema.DESCRIPTOR_BYTES == BYTES
    assert round(codec.MAX_RADIUS_M / codec.CELL_M) == MOST_PLACE_CELLS
    assert encode_place(WALL * 100.0, radius_m=99.0)[1] <= MOST_PLACE_CELLS
