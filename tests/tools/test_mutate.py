"""The tool that breaks the code to try the tests."""

import ast
from pathlib import Path

import pytest

from tools.checks.mutants import Mutant, mutants_of, random_mutants
from tools.checks.mutate import (
    Sandbox,
    kernels_on,
    main,
    rounds_for,
)
from tools.checks.safety_mutants import MUTANTS

ROOT = Path(__file__).resolve().parent.parent.parent
SOURCE = '''"""Says x < 1."""
LIMIT: "int | None" = 3


def within(x, é=2.0):
    if not x <= LIMIT and x != é:
        raise ValueError(f"{x + 1}" + "no")
    return (x
            + 1)
'''
SIGN = "def sign(x):\n    return 1 if x > 0 else 0\n\n\ndef idle(x):\n    return x + 1\n"


@pytest.fixture
def checkout(tmp_path):
    """A project of one function, with a test that tries only half of it."""
    for name, text in {
        "lemtomap/__init__.py": "",
        "lemtomap/nav/__init__.py": "",
        "lemtomap/nav/sign.py": SIGN,
        "tests/lemtomap/nav/test_sign.py": (
            "from lemtomap.nav.sign import sign\n\n\n"
            "def test_sign():\n    assert (sign(5), sign(-5)) == (1, 0)\n"
        ),
        "tests/robot/missions/test_lost.py": "",
        "tests/robot/missions/test_mission.py": "",
        "tests/robot/runs/test_lockstep.py": "",
        "tests/robot/test_reactions.py": "",
    }.items():
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return tmp_path


def test_every_mutant_changes_one_expression_and_can_be_run(tmp_path):
    file = tmp_path / "within.py"
    file.write_text(SOURCE)
    mutants = mutants_of(file, tmp_path)
    assert {mutant.old for mutant in mutants} >= {"not x <= LIMIT", "x <= LIMIT", "x != é", "3", "2.0"}
    assert not any("no" in mutant.old.split() or "None" in mutant.old for mutant in mutants)
    texts = [mutant.applied(SOURCE) for mutant in mutants]
    assert len(set(texts)) == len(texts)
    for text in texts:
        assert ast.dump(ast.parse(text)) != ast.dump(ast.parse(SOURCE))


def test_a_seed_chooses_the_same_mutants_again_and_another_one_others():
    def chosen(seed):
        return random_mutants(ROOT, ["lemtomap/topo/loops/judge.py"], 10, seed)

    assert chosen(1) == chosen(1) != chosen(2)


def test_what_no_test_notices_survives_and_the_checkout_is_left_alone(checkout, capsys, tmp_path_factory):
    before = {file: file.read_bytes() for file in checkout.rglob("*.py")}
    assert main(["lemtomap/nav/sign.py", "--only", "2: x > 0"], checkout) == 0
    told = capsys.readouterr().out.splitlines()
    assert "lemtomap/nav/sign.py:2: x > 0 -> (x <= 0)   [tests/lemtomap/nav/test_sign.py" in told[0]
    assert told[-1] == "1 of 1 mutants killed"
    sandbox = Sandbox(checkout, tmp_path_factory.mktemp("sandbox"))
    (idle,) = (each for each in random_mutants(checkout, ["lemtomap/nav"], 99, 0) if each.old == "x + 1")
    assert sandbox.killed_by(idle, [["tests/lemtomap"]]) == ""
    assert {file: file.read_bytes() for file in checkout.rglob("*.py")} == before


def test_tests_that_fail_anyway_tell_nothing_about_mutants(checkout):
    (checkout / "tests/lemtomap/nav/test_sign.py").write_text("def test_red():\n    assert False\n")
    with pytest.raises(SystemExit, match="test_red fails without any mutant"):
        main(["lemtomap/nav"], checkout)


def test_a_folder_without_code_is_refused_in_one_line(checkout, capsys):
    assert main(["lemtomap/nowhere"], checkout) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_the_nearest_tests_run_first():
    rounds = rounds_for("lemtomap/nav/route/watching.py", ROOT)
    assert rounds[0] == ["tests/lemtomap/nav/test_watching.py"]
    assert rounds[1:3] == [["tests/lemtomap/nav"], ["tests/lemtomap"]]
    assert rounds_for("lemtomap/topo/loops/judge.py", ROOT)[1] == ["tests/lemtomap/loops"]


def test_kernels_that_call_a_changed_one_are_compiled_anew(tmp_path):
    files = {
        "lines": "@njit(cache=True)\ndef length(): ...\n",
        "fit": "from lemtomap.lines import length\n\n\n@njit(cache=True)\ndef fit(): ...\n",
        "search": "from lemtomap import fit\n\n\n@njit\ndef search(): ...\n",
        "planes": "@njit(cache=True)\ndef plane(): ...\n",
        "caller": "from lemtomap.lines import length\n",
    }
    (tmp_path / "lemtomap").mkdir()
    for name, text in files.items():
        (tmp_path / "lemtomap" / f"{name}.py").write_text(text)
    stale = kernels_on(tmp_path / "lemtomap" / "lines.py", tmp_path)
    assert [file.stem for file in stale] == ["lines", "fit", "search"]
    assert kernels_on(tmp_path / "lemtomap" / "caller.py", tmp_path) == []


def test_every_hand_made_mutant_of_the_safety_chain_still_finds_its_line():
    for mutant in MUTANTS:
        assert isinstance(mutant, Mutant)
        text = (ROOT / mutant.path).read_text(encoding="utf-8")
        assert mutant.applied(text) != text
