"""However a run ends, it leaves map, trajectory, picture and summary. Simulated, on the virtual clock."""

import contextlib
import errno
import json
import os
import shutil
import signal
import subprocess
import threading

import pytest

from lemtomap.errors import BadSetting
from lemtomap.robot.build import build_core
from lemtomap.robot.cli.main import main
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.devices.recording import Recorder
from lemtomap.robot.exchange import Ended, MissionState
from lemtomap.robot.output.onlooker import Onlooker
from lemtomap.robot.output.progress import progress_bar
from lemtomap.robot.output.viewer import Viewer
from lemtomap.robot.runs import folder as run_folder
from lemtomap.robot.runs import run_files
from lemtomap.robot.runs.ending import Ending
from lemtomap.robot.runs.folder import RunFolder, Space
from lemtomap.robot.runs.run import Run, RunPlan, Teller
from lemtomap.robot.runs.simulated import SimOptions, run_sim
from lemtomap.topo.file.store import TopoStore

WHOLE = {"map.lemto", "trajectory.tum", "overview.png", "grid.pgm", "grid.yaml", "summary.json"}
FULL = OSError(errno.ENOSPC, "No space left on device")


def is_whole(out):
    """All results are there, and the map opens with nodes in it."""
    assert {path.name for path in out.iterdir()} >= WHOLE
    with TopoStore.view(out / "map.lemto") as store:
        assert sum(1 for _ in store.nodes()) > 0
    assert (out / "trajectory.tum").read_text().count("\n") > 5
    return json.loads((out / "summary.json").read_text())


def simulate(out, duration_s=4.0, **options):
    with progress_bar("test") as bar:
        return run_sim(
            SimOptions("office", "explore", duration_s, out, fast=True, live=False, **options), bar
        )


def after(calls, act):
    """Return a stand-in for a method that does `act` from its nth call on, before the method itself."""
    left = [calls]

    def wrap(method):
        def called(self, *args, **kwargs):
            left[0] -= 1
            if left[0] <= 0:
                act()
            return method(self, *args, **kwargs)

        return called

    return wrap


def fail():
    raise FULL


@pytest.fixture
def changed(monkeypatch):
    """Change a method of a class by a wrapper of it."""

    def change(owner, name, wrapper):
        monkeypatch.setattr(owner, name, wrapper(getattr(owner, name)))

    return change


@pytest.mark.parametrize("part", [(Recorder, "raw"), (Recorder, "derived"), (Viewer, "show_robot")])
def test_a_recorder_or_viewer_that_fails_is_said_once_and_the_run_goes_on(tmp_path, changed, part, capsys):
    changed(*part, after(30, fail))
    summary = simulate(tmp_path / "out")
    assert (summary["run_s"], summary["faults"]) == (pytest.approx(4.0), [])
    is_whole(tmp_path / "out")
    assert capsys.readouterr().err.count("No space left on device") == 1


def test_a_full_disk_ends_the_viewers_file_with_a_line_and_the_run_goes_on(tmp_path, monkeypatch, capsys):
    written = []

    def take(file, data):
        written.append(file.write(data))
        if len(written) > 5:
            raise FULL

    monkeypatch.setattr("lemtomap.robot.output.viewer_pipe._write_all", take)
    assert simulate(tmp_path / "out")["faults"] == []
    is_whole(tmp_path / "out")
    assert capsys.readouterr().err.count("run.rrd ends here: No space left on device") == 1


def test_a_viewer_that_cannot_open_its_window_says_so_and_goes_on_without(tmp_path, monkeypatch, capsys):
    def no_viewer(*_, **__):
        raise FileNotFoundError(errno.ENOENT, "No such file", "rerun")

    monkeypatch.setattr("lemtomap.robot.output.viewer_window.start_viewer", no_viewer)
    monkeypatch.setattr("lemtomap.robot.runs.simulated.has_display", lambda: True)
    with progress_bar("test") as bar:
        run_sim(SimOptions("office", "explore", 2.0, tmp_path / "out", fast=True), bar)
    is_whole(tmp_path / "out")
    assert capsys.readouterr().err.count("no live view") == 1


@pytest.mark.parametrize(
    ("owner", "name", "lost"),
    [
        (Viewer, "close", None),
        (Recorder, "close", None),
        (run_files.outputs, "write_trajectory", "trajectory.tum"),
        (run_files.outputs, "write_grid", "grid.pgm"),
        (run_files, "draw", "overview.png"),
    ],
)
def test_each_step_of_the_end_runs_whatever_became_of_another(tmp_path, monkeypatch, owner, name, lost):
    def broken(*_args, **_options):
        raise FULL

    monkeypatch.setattr(owner, name, broken)
    summary = simulate(tmp_path / "out")
    assert len(summary["faults"]) == 1
    assert "No space left on device" in summary["faults"][0]
    left = {path.name for path in (tmp_path / "out").iterdir()}
    assert left >= WHOLE - {lost, "grid.yaml"}


def test_without_a_fit_of_the_drive_there_is_still_a_trajectory(tmp_path, monkeypatch):
    def no_fit(mapper, *, whole_drive):
        if whole_drive:
            raise ArithmeticError("singular")
        return placed(mapper, whole_drive=False)

    placed = run_files.final_map
    monkeypatch.setattr(run_files, "final_map", no_fit)
    assert simulate(tmp_path / "out")["faults"] == ["final map: singular"]
    is_whole(tmp_path / "out")


def test_a_step_that_hangs_is_left_behind_and_the_next_one_runs():
    said, held = [], threading.Event()
    ending = Ending(said.append)
    assert ending.step("viewer", 0.05, held.wait) is None
    assert ending.step("map", 5.0, lambda: 7) == 7
    held.set()
    assert said == ending.failed == ["viewer: not done after 0.05 s, left as it is"]


def test_a_folder_deleted_under_way_is_told_at_once_and_made_again(tmp_path, changed, monkeypatch, capsys):
    monkeypatch.setattr(run_files, "FOLDER_PERIOD_S", 0.0)
    out = tmp_path / "deep" / "out"
    changed(Onlooker, "look", after(10, once(lambda: shutil.rmtree(out.parent))))
    summary = simulate(out)
    said = capsys.readouterr().err
    (told_s,) = [float(line.split()[0]) for line in said.splitlines() if f"{out} is gone" in line]
    assert told_s < 2.0
    assert is_whole(out)["map"] == str(out / "map.lemto")
    assert summary["faults"] == []


def once(act):
    """Return what does `act` at its first call only."""
    acts = [act]
    return lambda: acts.pop()() if acts else None


def test_a_map_whose_file_was_deleted_is_written_anew_beside_what_took_its_place(tmp_path):
    for taken in (False, True):
        folder = tmp_path / str(taken)
        folder.mkdir()
        store = TopoStore.create(folder / "map.lemto")
        store.add_node()
        store.commit()
        store.path.unlink()
        if taken:
            store.path.write_text("mine")
        store.add_node()
        store.close()
        with TopoStore.open(store.path) as again:
            assert sum(1 for _ in again.nodes()) == 2
        assert not taken or (folder / "map.lemto").read_text() == "mine"
        assert (store.path.name == "map.lemto") is not taken


def test_two_runs_cannot_share_a_folder_and_the_lock_ends_with_its_owner(tmp_path, capsys):
    out = tmp_path / "out"
    first = RunFolder(out)
    (out / "map.lemto").write_text("the first run's")
    assert main(["sim", "--fast", "--duration", "1", "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert said == f"lemtomap: {out}: another run writes there; give another --out\n"
    assert (out / "map.lemto").read_text() == "the first run's"
    first.close()
    RunFolder(out).close()


def test_a_folder_that_another_run_took_is_left_to_it(tmp_path):
    mine = RunFolder(tmp_path / "out")
    (tmp_path / "out").rename(tmp_path / "moved")
    assert not mine.here
    theirs = RunFolder(tmp_path / "out")
    assert mine.renew().parent == tmp_path
    assert mine.path != theirs.path
    assert mine.here
    assert theirs.here


def test_replay_over_its_own_recording_is_refused_and_loses_nothing(tmp_path, capsys):
    run = tmp_path / "run"
    simulate(run, 2.0)
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    (tmp_path / "link").symlink_to(run)
    for given, out in (
        (run, run),
        (run / "run.mcap", run),
        (tmp_path / "link", run),
        (run, tmp_path / "link"),
    ):
        assert main(["replay", str(given), "--out", str(out)]) == 2
        assert "holds the recording itself" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("command", ["sim", "replay"])
def test_each_interrupt_ends_a_run_with_130_and_its_results(tmp_path, changed, number, command, capsys):
    words = ["sim", "--fast", "--duration", "60"]
    if command == "replay":
        simulate(tmp_path / "run", 6.0)
        words = ["replay", str(tmp_path / "run")]
    changed(Onlooker, "look", after(30, lambda: os.kill(os.getpid(), number)))
    with contextlib.ExitStack() as kept:
        for stream in (1, 2):  # SIGHUP drops the terminal, which may be the one of the tests
            descriptor = os.dup(stream)
            kept.callback(os.close, descriptor)
            kept.callback(os.dup2, descriptor, stream)
        assert main([*words, "--out", str(tmp_path / "out")]) == 130
    summary = is_whole(tmp_path / "out")
    assert summary["interrupted"]
    assert summary["run_s"] < 6.0


def test_an_interrupted_map_leaves_nothing_and_says_so(tmp_path, monkeypatch, capsys):
    def interrupted(*_):
        os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr("lemtomap.robot.runs.map_log.open_log", interrupted)
    assert main(["map", "any.clf", "--out", str(tmp_path / "out")]) == 130
    assert "nothing was written" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("heard", "line"),
    [
        (set(), "the base on /dev/k sent no packets, the laser on /dev/h sent no scans"),
        ({"kobuki"}, "the laser on /dev/h sent no scans"),
        ({"hokuyo"}, "the base on /dev/k sent no packets"),
        ({"kobuki", "hokuyo"}, ""),
    ],
)
def test_a_run_without_base_or_laser_has_failed_and_names_what_was_missing(tmp_path, heard, line):
    facts = {"kobuki": "/dev/k", "hokuyo": "/dev/h"}
    plan = RunPlan(tmp_path, tmp_path / "m.lemto", "", 0, "window", RobotConfig(), facts=facts)
    with progress_bar("test") as bar, Run(plan, Teller(bar, 1.0)) as run:
        run.core.base.heard.update(heard)
        run.end(Ended(1.0, MissionState.WAITING, "no map yet"))
    assert run.summary["faults"] == [line] * bool(line)
    assert run.summary["result"] == ("failed" if line else "waiting")


def test_the_map_line_names_the_file_that_was_mapped_into(tmp_path, capsys):
    plan = ["--map", str(tmp_path / "elsewhere.lemto"), "--out", str(tmp_path / "out")]
    assert main(["sim", "--fast", "--duration", "2", "--mission", "explore", *plan]) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("map ")]
    assert line.split()[1] == str(tmp_path / "elsewhere.lemto")
    assert (tmp_path / "elsewhere.lemto").exists()


# ---- a full disk ----


@pytest.fixture
def small_disk(tmp_path):
    """A disk of 12 MB of its own."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount, unmount = shutil.which("mount"), shutil.which("umount")
    if mount is None or unmount is None or os.geteuid() != 0:
        pytest.skip("only root can mount a small disk")
    command = [mount, "-t", "tmpfs", "-o", "size=12m", "tmpfs", str(folder)]
    if subprocess.run(command, check=False, capture_output=True).returncode:  # noqa: S603 - our own command
        pytest.skip("no disk can be mounted here")
    yield folder
    subprocess.run([unmount, "-l", str(folder)], check=True)  # noqa: S603 - as above


def fill(folder):
    """Leave not a byte free."""
    with (folder / "fill").open("ab", buffering=0) as file, contextlib.suppress(OSError):
        while True:
            file.write(bytes(1024))


def test_a_disk_filled_at_a_blow_ends_the_run_with_its_results_and_code_2(small_disk, changed, capsys):
    out = small_disk / "out"
    changed(Onlooker, "look", after(25, once(lambda: fill(small_disk))))
    assert main(["sim", "--fast", "--duration", "600", "--out", str(out)]) == 2
    summary = is_whole(out)
    assert summary["faults"] == [f"{out}: the disk is full"]
    assert summary["run_s"] < 60.0
    assert capsys.readouterr().err.splitlines()[-1] == f"lemtomap: {out}: the disk is full"


def test_recordings_end_before_the_room_of_the_map_is_gone_and_the_robot_drives_on(
    small_disk, changed, monkeypatch, capsys
):
    monkeypatch.setattr(run_files, "FOLDER_PERIOD_S", 0.0)
    out = small_disk / "out"

    def leave_a_sixth():
        (small_disk / "fill").write_bytes(bytes(shutil.disk_usage(small_disk).free - 2_000_000))

    changed(Onlooker, "look", after(10, once(leave_a_sixth)))
    summary = simulate(out, 6.0)
    assert (summary["run_s"], summary["faults"]) == (pytest.approx(6.0), [])
    said = capsys.readouterr().err
    assert said.count("run.mcap ends here: only 2 MB are free") == 1
    assert said.count("run.rrd ends here: only 2 MB are free") == 1
    is_whole(out)


def test_a_disk_without_room_is_refused_before_anything_is_made(small_disk, capsys):
    fill(small_disk)
    assert main(["sim", "--fast", "--duration", "1", "--out", str(small_disk / "out")]) == 2
    assert "the disk is full; a run needs 1 MB at least" in capsys.readouterr().err
    assert [path.name for path in small_disk.iterdir()] == ["fill"]


def test_the_room_kept_for_the_results_is_given_back(small_disk):
    before = shutil.disk_usage(small_disk).free
    space = Space(small_disk)
    assert shutil.disk_usage(small_disk).free < before - before // 9
    assert list(small_disk.iterdir()) == []
    space.release()
    assert shutil.disk_usage(small_disk).free == before


def test_a_failed_start_leaves_no_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(run_folder.os, "posix_fallocate", lambda *_: fail())
    plan = RunPlan(tmp_path / "a" / "b", tmp_path / "m.lemto", "", 0, "window", RobotConfig())
    with progress_bar("test") as bar, pytest.raises(BadSetting, match="No space left"):
        Run(plan, Teller(bar, 1.0)).__enter__()
    assert list(tmp_path.iterdir()) == []


def test_a_commit_asks_for_room_first(tmp_path):
    core, asked = build_core(RobotConfig(), tmp_path / "map.lemto"), []
    store = core.mapping.mapper.topo.store
    store.before_commit = lambda: asked.append(store._db.in_transaction)
    store.add_node()
    store.commit()
    store.commit()
    assert asked == [True]
    core.close()
