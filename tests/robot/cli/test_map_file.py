"""Maps, names and places at the command line: one line for what cannot be, and then nothing has moved."""

import subprocess
import sys

import numpy as np
import pytest

from lemtomap import se2
from lemtomap.robot.cli.main import main
from lemtomap.robot.missions.missions import parse_mission
from lemtomap.robot.missions.places import check_places
from lemtomap.robot.output import overview as overview_module
from lemtomap.robot.output.overview import Overview, draw
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge
from lemtomap.types import EdgeType, GridView


@pytest.fixture
def office(tmp_path):
    """Nodes 1 to 9 in a row, a metre apart; node 3 is called kitchen."""
    path = tmp_path / "office.lemto"
    with TopoStore.create(path) as store:
        for _ in range(9):
            store.add_node()
        for k in range(1, 9):
            edge = Edge(0, k, k + 1, np.array([1.0, 0, 0]), np.eye(3) * 1e-3, EdgeType.ODOMETRY)
            store.add_edge(edge)
        store.set_name("kitchen", 3)
    return path


@pytest.fixture
def say(capsys):
    """Run a command; return its exit code and what it said, on either stream."""

    def run(*arguments):
        code = main([str(argument) for argument in arguments])
        said = capsys.readouterr()
        return code, said.out + said.err

    return run


def test_a_name_that_moves_says_where_it_was(say, office):
    assert say("edit", office, "name", 3, "Küche") == (0, "node 3 is now 'Küche'; it was 'kitchen'\n")
    told = "node 5 is now 'Küche', which was node 3 until now\n"
    assert say("edit", office, "name", "5", "Küche") == (0, told)
    assert "'Küche', until then node 3" in say("edit", office, "history")[1]


def test_a_level_below_the_ground_needs_no_tricks(say, office):
    assert say("edit", office, "level", "3", "-1") == (0, "node 3 is on level -1\n")
    assert "-1: 1 nodes" in say("info", office)[1]
    assert say("edit", office, "--help")[0] == 0


WRONG_EDITS = [
    ("name", "3", "far"),
    ("name", "3", "a,b"),
    ("name", "3", "\x1b[31m"),
    ("name", "99", "hall"),
    ("name", "9" * 5000, "hall"),
    ("unname", "cellar"),
    ("unname", "\x1b]0;title\x07"),
    ("block", "1", "9"),
    ("delete", "kichen"),
    ("level", "3", "1e3"),
    ("level", "3", "9" * 50),
    ("level", "3", "-1000"),
    ("level", "3", "--up"),
    ("\x1b[2J", "3"),
]


@pytest.mark.parametrize("words", WRONG_EDITS, ids=range(len(WRONG_EDITS)))
def test_an_edit_that_cannot_be_is_one_line_and_leaves_the_file_as_it_was(say, office, words):
    before = office.read_bytes()
    code, said = say("edit", office, *words)
    assert code == 2
    assert said.startswith("lemtomap: ")
    assert said.removesuffix("\n").isprintable()
    assert len(said) < 400
    assert office.read_bytes() == before
    assert [path.name for path in office.parent.iterdir()] == ["office.lemto"]


def test_an_edit_and_its_undo_of_a_map_at_rest_leave_a_map_at_rest(say, office):
    assert say("edit", office, "block", "kitchen", "4")[0] == 0
    assert say("edit", office, "undo") == (0, "taken back: block the way 3 - 4\n")
    assert say("edit", office, "undo") == (0, "nothing to take back\n")
    assert [path.name for path in office.parent.iterdir()] == ["office.lemto"]


def test_what_an_old_map_calls_a_place_is_shown_without_its_escapes_and_can_be_taken_away(say, office):
    with TopoStore.open(office) as store:
        store.set_name("\x1b[31mred\x07", 4)
        store.set_name("a, b", 5)
        store.write("INSERT INTO journal(stamp, what, before) VALUES(0, ?, '[]')", ("x\x1b[2J" + "y" * 5000,))
    code, said = say("info", office)
    assert code == 0
    assert all(line.isprintable() for line in said.splitlines())
    assert r"'\x1b[31mred\x07' = 4, 'a, b' = 5, kitchen = 3" in said
    history = say("edit", office, "history")[1].strip()
    assert history.isprintable()
    assert len(history) <= 210
    for name in (r"\x1b[31mred\x07", "'a, b'"):
        assert say("edit", office, "unname", name)[0] == 0
    assert "names         kitchen = 3" in say("info", office)[1]


def test_an_export_tells_what_it_left_out(say, office):
    assert say("edit", office, "block", "1", "2")[0] == 0
    for suffix, told in ((".geojson", True), (".g2o", True), (".graphml", False)):
        said = say("export", office, office.with_suffix(suffix))[1]
        assert ("left out as closed by hand: 1" in said) is told


GOING_NOWHERE = [
    ("goto", "kichen", "--map"),
    ("goto", "99", "--map"),
    ("goto", "\x1b[31m", "--map"),
    ("run", "--mission", "explore,goto:kichen", "--map"),
    ("run", "--mission", "goto:12", "--map"),
    ("sim", "--fast", "--mission", "goto:kitchen,goto:nowhere", "--map"),
]


@pytest.mark.parametrize("command", GOING_NOWHERE, ids=range(len(GOING_NOWHERE)))
def test_a_place_that_is_not_there_is_refused_before_anything_begins(say, office, command, monkeypatch):
    monkeypatch.chdir(office.parent)
    monkeypatch.setattr("lemtomap.robot.runs.simulated.run_sim", None)
    monkeypatch.setattr("lemtomap.robot.runs.real.run_robot", None)
    before = office.read_bytes()
    code, said = say(*command, office)
    assert code == 2
    assert said.startswith(f"lemtomap: {office}: there is no place '")
    if "kichen" in str(command):
        assert said.endswith("(did you mean 'kitchen'?)\n")
    assert said.strip().isprintable()
    assert office.read_bytes() == before
    assert [path.name for path in office.parent.iterdir()] == ["office.lemto"]


def test_on_a_new_map_there_is_no_name_to_go_to(say, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for command in (("sim", "--fast"), ("run",), ("run", "--map", "new.lemto")):
        code, said = say(*command, "--mission", "goto:kitchen")
        assert (code, said) == (2, "lemtomap: a new map: there is no place 'kitchen' (names: none)\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "mission",
    ["goto:kitchen", "goto:9", "goto:far", "goto:here,goto:start", "explore,goto:99", "tour,goto:99", "dock"],
)
def test_a_mission_to_places_that_are_or_may_come_to_be_passes(office, mission):
    check_places(mission, office)
    parse_mission(mission)


def test_whether_a_place_is_there_is_known_without_what_drives_a_robot(office):
    """Loading that takes seconds, which a person with a wrong name need not wait."""
    code = f"""
import sys
from lemtomap.robot.cli.main import main
assert main(["goto", "kichen", "--map", {str(office)!r}]) == 2
assert not {{"numba", "lemtomap.robot.runs.runtime", "matplotlib"}} & set(sys.modules)
"""
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)  # noqa: S603


def overview_of(name):
    grid = GridView(0.0, np.zeros((40, 40), np.int8), 0.05, (0.0, 0.0))
    return Overview(
        T_map_node={1: np.zeros(3), 2: np.array([1.0, 0.5, 0.0])},
        edges=[(1, 2, EdgeType.ODOMETRY)],
        trajectory=np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.0]]),
        walls=np.random.default_rng(1).uniform(0.0, 2.0, (50, 2)),
        grid=grid,
        T_map_grid=se2.IDENTITY,
        names={2: name},
        title=f"run: goto:{name}",
        facts=[f"mission  goto:{name}"],
    )


@pytest.mark.parametrize("name", [r"lab $\foo$", "$", "\u53a8\u623f", "\x1b[31m\x00", "long" * 1000])
def test_the_picture_of_a_run_is_drawn_whatever_its_places_and_its_folder_are_called(tmp_path, name):
    draw(tmp_path / "overview.png", overview_of(name))
    assert (tmp_path / "overview.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("painter", "reason"),
    [("raise SystemExit('no room left for colours')", "no room left"), ("import os; os.abort()", "-6")],
)
def test_a_painter_that_fails_is_told_in_a_line_and_the_old_picture_stays(
    tmp_path, monkeypatch, painter, reason
):
    (tmp_path / "overview.png").write_bytes(b"old")
    monkeypatch.setattr(overview_module, "python", lambda *_: [sys.executable, "-c", painter])
    with pytest.raises(OSError, match=reason):
        draw(tmp_path / "overview.png", overview_of("kitchen"))
    assert [path.name for path in tmp_path.iterdir()] == ["overview.png"]
    assert (tmp_path / "overview.png").read_bytes() == b"old"
