"""The fuzzer of the readers notices what it is there for, and finds nothing in a handful of cases."""

import json
import random
import subprocess
import sys
from importlib.util import find_spec

import pytest

from tools.checks.fuzz_readers import KINDS, judge, make_case
from tools.checks.isolation import Outcome
from tools.checks.mcap_damage import MCAP, mcap_bytes, mcap_records

LINE = "lemtomap: hall.clf:3: 'x' stands where a number belongs\n"

WORK = """
import json, sys, time
from pathlib import Path
from tools.checks.isolation import Limits, Task, run_all

def refuse():
    sys.stderr.write("lemtomap: no\\n")
    return 2

def eat():
    held = []
    while True:
        held.append(bytearray(10**7))

def spin():
    while True:
        pass

works = {"refuse": refuse, "crash": lambda: 1 // 0, "eat": eat, "spin": spin, "wait": lambda: time.sleep(60)}
folder = Path(sys.argv[1])
for name in works:
    (folder / name).mkdir()
for name, work in works.items():
    limits = Limits(cpu_s=0.9, wall_s=0.5 if name == "wait" else 60.0, memory_mb=200.0)
    for _, outcome in run_all([Task(name, folder / name, work)], limits, jobs=1):
        print(json.dumps([name, outcome.code, outcome.stderr, outcome.overrun]))
"""


def outcome(code=0, stderr="", overrun=""):
    return Outcome(code, "", stderr, 0.1, 50.0, overrun)


@pytest.fixture
def case(tmp_path):
    made = make_case("carmen", b"FLASER 2 1 1 0 0 0 0 0 0 1 h 1\n", 5, 0)
    made.lay_out(tmp_path)
    return made


def test_work_in_a_child_is_held_to_its_limits_and_its_traceback_is_kept(tmp_path):
    command = [sys.executable, "-c", WORK, str(tmp_path)]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout  # noqa: S603
    ended = {name: rest for name, *rest in map(json.loads, told.splitlines())}
    assert ended["refuse"] == [2, "lemtomap: no\n", ""]
    assert "ZeroDivisionError" in ended["crash"][1]
    assert "MemoryError" in ended["eat"][1]
    assert "CPU" in ended["spin"][2]
    assert "still running" in ended["wait"][2]


def test_a_clean_end_and_one_line_of_refusal_are_accepted(case, tmp_path):
    assert judge(case, outcome(), tmp_path) == ""
    assert judge(case, outcome(2, "hall.clf: a remark\n" + LINE), tmp_path) == ""


@pytest.mark.parametrize(
    ("ended", "wrong"),
    [
        (outcome(1, "lemtomap: unexpected ValueError: x\n"), "exit 1"),
        (outcome(-11), "exit -11"),
        (outcome(2, "Traceback (most recent call last):\n" + LINE), "exit 2"),
        (outcome(0, "Traceback (most recent call last):\n"), "exit 0"),
        (outcome(2, ""), "0 lines of refusal"),
        (outcome(2, LINE * 2), "2 lines of refusal"),
        (outcome(2, LINE + "and more\n"), "1 lines of refusal"),
        (outcome(2, LINE, "12.0 s of CPU"), "12.0 s of CPU"),
    ],
)
def test_anything_else_is_a_failure(case, tmp_path, ended, wrong):
    assert judge(case, ended, tmp_path).startswith(wrong)


def test_what_a_refusal_leaves_behind_is_a_failure(case, tmp_path):
    (tmp_path / "out").mkdir()
    assert judge(case, outcome(), tmp_path) == ""
    assert judge(case, outcome(2, LINE), tmp_path) == "left behind: out"
    (tmp_path / "out" / ".grid.pgm.part").touch()
    assert ".grid.pgm.part" in judge(case, outcome(), tmp_path)


def test_a_reader_that_changes_its_input_is_a_failure(case, tmp_path):
    (tmp_path / "hall.clf").write_bytes(b"")
    assert judge(case, outcome(), tmp_path) == "hall.clf is not what it was"


def test_a_refused_sound_file_is_a_failure(tmp_path):
    case = make_case("carmen", b"sound", 0, 0)
    case.lay_out(tmp_path)
    assert judge(case, outcome(2, LINE), tmp_path).startswith("refuses a sound file")


def test_a_case_can_be_made_again():
    sound = KINDS["tinyslam"].make(None)
    assert make_case("tinyslam", sound, 7, 3) == make_case("tinyslam", sound, 7, 3)
    others = {make_case("tinyslam", sound, 7, seed).data for seed in range(10)}
    assert len(others) > 5


def test_records_of_a_recording_go_apart_and_together():
    records = [(1, b"head"), (6, b""), (200, b"x" * 300)]
    assert mcap_records(mcap_bytes(records)) == records
    assert all(callable(mutation) for mutation in MCAP)


def test_damaged_text_differs_from_the_sound_one():
    sound = KINDS["world"].make(None)
    rng = random.Random(1)
    damaged = [mutation(sound, rng) for mutation in KINDS["world"].mutations]
    assert sum(one != sound for one in damaged) > 0.8 * len(damaged)


@pytest.mark.skipif(find_spec("pybullet") is None, reason="needs pybullet")
def test_every_reader_survives_a_handful_of_damaged_files():
    command = [sys.executable, "-m", "tools.checks.fuzz_readers", "--count", "2", "--seed", "1"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert all(f"\n{kind} " in ended.stdout for kind in KINDS)
