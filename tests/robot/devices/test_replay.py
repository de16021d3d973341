"""A recording holds everything that made the samples."""

import json
import math
import pickle

import numpy as np
import pytest

from lemtomap.drivers.hokuyo.events import LaserScan
from lemtomap.drivers.kobuki.events import KobukiSample
from lemtomap.errors import BadLog, BadSetting
from lemtomap.robot.build import build_core
from lemtomap.robot.cli.main import main
from lemtomap.robot.config import LaserConfig, RobotConfig
from lemtomap.robot.devices.mapped_scan import MappedScan, from_values, to_values
from lemtomap.robot.devices.recorded import Gap, Recording
from lemtomap.robot.devices.recording import HOKUYO, KOBUKI, Recorder
from lemtomap.robot.devices.replay import replay_events, replay_map
from lemtomap.robot.devices.wire import RecordedHokuyoSession, RecordedKobukiSession, Wire
from lemtomap.robot.output.progress import Bar
from lemtomap.robot.runs.replayed import Changes, replay_run, settings_for
from lemtomap.robot.runs.simulated import SimOptions, run_sim
from lemtomap.sim import worlds
from lemtomap.sim.errors import Unplugged
from lemtomap.sim.faults import Faults, LinkFaults
from lemtomap.sim.simulator import Simulator
from lemtomap.topo import events
from lemtomap.topo.file import schema


def record(path, seconds, **options):
    """Listen to a noisy robot whose cables are pulled now and then; return what it told."""
    noisy = LinkFaults(lose_byte=1e-3, flip_bit=1e-4, burst_s=0.016, unplugged=((1.5, 1.9), (3.0, 3.2)))
    simulator = Simulator(worlds.load("office"), seed=2, faults=Faults(kobuki=noisy, hokuyo=noisy))
    recorder = Recorder(path, **options)
    base_session = RecordedKobukiSession(recorder.raw)
    base = Wire(KOBUKI, simulator.kobuki, base_session, recorder.raw, Unplugged)
    laser_session = RecordedHokuyoSession(recorder.raw)
    laser = Wire(HOKUYO, simulator.hokuyo, laser_session, recorder.raw, Unplugged)
    told = []
    for step in range(1, round(seconds * 50)):
        now_s = step * 20_000_000 * 1e-9
        simulator.advance(now_s)
        told += base.poll(now_s)
        told += laser.poll(now_s)
        base.write(base_session.drive(0.1, 0.2), now_s)
    recorder.close()
    simulator.close()
    return told


def test_the_same_samples_come_out_bit_for_bit(tmp_path):
    told = record(tmp_path / "run.mcap", 5.0)
    again = [
        event
        for _, samples in replay_events(Recording.open(tmp_path))
        for event in (*samples.base, *samples.laser)
    ]
    assert sum(isinstance(event, LaserScan) for event in told) > 15
    assert sum(isinstance(event, KobukiSample) for event in told) > 150
    assert [pickle.dumps(event) for event in again] == [pickle.dumps(event) for event in told]


def test_a_recorded_run_can_be_mapped_again(tmp_path):
    told = record(tmp_path / "run.mcap", 5.0)
    core = build_core(RobotConfig(), tmp_path / "map.lemto", durable=False)
    end_s = replay_map(Recording.open(tmp_path), core, as_then=False)
    trail = np.concatenate(list(core.mapping.mapper.topo.trail.records()))
    core.close()
    assert 4.9 < end_s <= 5.0
    whole = sum(isinstance(event, LaserScan) and event.complete for event in told)
    assert whole - 4 <= len(trail) <= whole


class Silent(Bar):
    """No bar."""

    def __init__(self):
        self.said = []

    def show(self, share, count=0, speed=None):
        pass

    def say(self, text):
        self.said.append(text)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Return the folder of a short exploring run."""
    out = tmp_path_factory.mktemp("run") / "sim"
    run_sim(SimOptions("office", "explore", 12.0, out, seed=3, fast=True, live=False), Silent())
    return out


def rows(folder):
    """Return every row of every table of a run's map."""
    connection = schema.connect(folder / "map.lemto")
    names = [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
    held = {name: connection.execute(f"SELECT * FROM {name}").fetchall() for name in names}  # noqa: S608
    connection.close()
    return held


def copied(run, tmp_path, change):
    """Return a folder with the run's recording, changed."""
    folder = tmp_path / "changed"
    folder.mkdir()
    (folder / "run.mcap").write_bytes(change((run / "run.mcap").read_bytes()))
    return folder


def test_a_replay_leaves_the_same_trajectory_and_the_same_map_with_openings_and_ground(run, tmp_path):
    summary = replay_run(run, tmp_path / "again", Silent())
    held, again = rows(run), rows(tmp_path / "again")
    assert all(held[table] for table in ("node", "edge", "place", "placeholder", "ground"))
    assert len(held["placeholder"]) > 5
    assert again == held
    for name in ("trajectory.tum", "grid.pgm", "grid.yaml"):
        assert (tmp_path / "again" / name).read_bytes() == (run / name).read_bytes()
    assert summary["result_text"] == "replayed, scan for scan as in the run"
    assert summary["same_map"] is True


def test_scans_that_the_mapper_left_out_are_left_out_again(run, tmp_path):
    recording = Recording.open(run)
    kept = list(recording.scans())[::2]
    recording.scans = lambda: iter(kept)
    settings = settings_for(recording)
    core = build_core(settings.config, tmp_path / "map.lemto", seed=settings.seed, durable=False)
    replay_map(recording, core, as_then=True)
    mapped = [mapped.stamp_s for mapped in core.exchange.mapped_scans.drain()]
    core.close()
    assert mapped == [scan.stamp_s for scan in kept]


def test_a_cut_recording_is_replayed_up_to_the_cut_and_says_so(run, tmp_path):
    folder = copied(run, tmp_path, lambda data: data[: len(data) * 6 // 10])
    summary = replay_run(folder, tmp_path / "again", Silent())
    ends_s = Recording.open(folder).ends_s
    assert f"it ends at {ends_s:.1f} s" in summary["result_text"]
    assert summary["missing_s"] == [[pytest.approx(ends_s), None]]
    assert summary["same_map"] is False
    cut = (tmp_path / "again" / "trajectory.tum").read_text().splitlines()
    assert 30 < len(cut) < len((run / "trajectory.tum").read_text().splitlines())


def test_after_a_damaged_chunk_the_rest_is_mapped_and_the_gap_is_told(run, tmp_path):
    folder = copied(run, tmp_path, lambda data: data)
    path = folder / "run.mcap"
    chunks = Recording.open(folder)._files[0].content
    middle = chunks[len(chunks) // 2]
    data = bytearray(path.read_bytes())
    data[middle.end - 200 : middle.end - 100] = bytes(100)
    path.write_bytes(data)
    summary = replay_run(folder, tmp_path / "again", Silent())
    last_s = float((tmp_path / "again" / "trajectory.tum").read_text().splitlines()[-1].split()[0])
    assert last_s > 11.0
    assert "bytes are missing from" in summary["result_text"]


def test_a_robot_that_drove_on_during_a_long_gap_is_mapped_in_a_new_part(run, tmp_path):
    recording = Recording.open(run)
    whole = list(recording.entries())
    gap = Gap(3.0, 8.0, "lost")
    recording.entries = lambda: iter(
        [*(e for e in whole if e.now_s < 3.0), gap, *(e for e in whole if e.now_s > 8.0)]
    )
    core = build_core(RobotConfig(), tmp_path / "map.lemto", durable=False)
    replay_map(recording, core, as_then=True)
    told = [note.text for note in core.exchange.notes.drain() if note.source == "mapping"]
    core.close()
    assert told[0] == "nothing is recorded of the next 5 s"


def test_the_latest_parts_alone_can_be_replayed(tmp_path):
    told = record(tmp_path / "run.mcap", 6.0, limit_bytes=200_000)
    scans = sum(isinstance(event, LaserScan) for event in told)
    (tmp_path / "run.mcap").unlink()
    recording = Recording.open(tmp_path)
    assert recording.begins_s > 0.5
    again = [event for _, samples in replay_events(recording) for event in samples.laser]
    assert 5 < sum(isinstance(event, LaserScan) for event in again) < scans


def test_other_settings_than_the_run_s_are_told(run):
    recording = Recording.open(run)
    assert settings_for(recording).as_then
    assert settings_for(recording, Changes("window", 3)).as_then
    assert "other settings" in settings_for(recording, Changes("rolling")).why_not
    assert "other settings" in settings_for(recording, Changes(seed=4)).why_not
    recording.about["new_map"] = False
    assert "went on with a map" in settings_for(recording).why_not
    recording.about["config"] = {"strange": 1}
    assert "cannot be used: strange: unknown key" in settings_for(recording).why_not
    del recording.about["config"]
    assert "does not tell" in settings_for(recording).why_not


def test_a_recording_is_mapped_with_the_configuration_of_its_run(run):
    recording = Recording.open(run)
    recording.about["config"]["laser"]["x_m"] = 0.15
    assert settings_for(recording).config.laser.x_m == 0.15


def test_one_setting_is_changed_over_those_of_the_run_and_a_file_replaces_them_all(run, tmp_path):
    recording = Recording.open(run)
    recording.about["config"]["laser"]["x_m"] = 0.15
    changed = settings_for(recording, Changes(orders=("laser.y_m=0.05",)))
    assert (changed.config.laser.x_m, changed.config.laser.y_m) == (0.15, 0.05)
    assert changed.why_not == "mapped with other settings than the run's"
    assert settings_for(recording, Changes(orders=("laser.x_m=0.15",))).as_then
    file = tmp_path / "robot.toml"
    file.write_text("[laser]\ny_m = 0.02\n")
    replaced = settings_for(recording, Changes(file=file, orders=("laser.yaw_rad=1",)))
    assert replaced.config.laser == LaserConfig(0.0, 0.02, 1.0)
    assert (replaced.as_then, replaced.why_not) == (False, f"with the settings of {file}, not the run's own")


def test_a_run_is_recorded_with_its_settings_and_replayed_with_them_from_the_command_line(tmp_path, capsys):
    run, again, other = (tmp_path / name for name in ("run", "again", "other"))
    seconds = ["--fast", "--duration", "4", "--mission", "explore", "--set", "laser.x_m=-0.05"]
    assert main(["sim", *seconds, "--out", str(run)]) == 0
    assert json.loads((run / "summary.json").read_text())["config"]["laser"]["x_m"] == -0.05
    assert main(["replay", str(run), "--out", str(again)]) == 0
    assert (again / "trajectory.tum").read_bytes() == (run / "trajectory.tum").read_bytes()
    capsys.readouterr()
    assert main(["replay", str(run), "--out", str(other), "--set", "laser.x_m=0.05"]) == 0
    assert "mapped with other settings than the run's" in capsys.readouterr().out
    assert json.loads((other / "summary.json").read_text())["config"]["laser"]["x_m"] == 0.05
    assert (other / "trajectory.tum").read_bytes() != (run / "trajectory.tum").read_bytes()


def test_a_bad_setting_for_a_replay_is_refused_and_leaves_nothing(run, tmp_path, capsys):
    command = ["replay", str(run), "--out", str(tmp_path / "out"), "--set", "slam.window_m=1"]
    assert main(command) == 2
    assert capsys.readouterr().err.startswith("lemtomap: --set slam.window_m=1: slam.window_m: 1 must lie")
    assert not list(tmp_path.iterdir())


def test_a_recording_without_a_scan_is_refused_and_leaves_nothing(tmp_path):
    record(tmp_path / "run.mcap", 0.1)
    with pytest.raises(BadLog, match="holds no scan to map"):
        replay_run(tmp_path, tmp_path / "again", Silent())
    assert not (tmp_path / "again").exists()


def test_a_replay_into_the_recording_s_own_folder_is_refused(run):
    before = sorted(path.name for path in run.iterdir())
    with pytest.raises(BadSetting, match="holds the recording itself"):
        replay_run(run, run, Silent())
    assert sorted(path.name for path in run.iterdir()) == before


def test_events_of_navigation_come_back_as_they_were():
    told = (
        events.EdgeTraversed(1, 2, 0.1 + 0.2),
        events.EdgeBlocked(1, 2, 1e18),
        events.Bumped("bump", 0.1, -0.2, 3.0),
        events.OpeningSeen(np.int64(4), 1, np.float64(0.1), 0.2, 0.3, 0.9),
        events.OpeningDone(4, closed=True),
        events.GroundSeen(1, bytes(range(256))),
        events.NothingKnownHere(),
        events.LevelChanged(-1),
    )
    mapped = MappedScan(0.1 + 0.2, False, told)
    assert from_values(json.loads(json.dumps(to_values(mapped)))) == mapped


@pytest.mark.parametrize(
    "event",
    [
        {"event": "Nothing"},
        {"event": "EdgeTraversed", "from_id": 1, "to_id": 2},
        {"event": "EdgeTraversed", "from_id": 1, "to_id": 2.5, "time_s": 1.0},
        {"event": "EdgeTraversed", "from_id": 1, "to_id": 2, "time_s": math.nan},
        {"event": "LevelChanged", "level": 2**70},
        {"event": "LevelChanged", "level": True},
        {"event": "GroundSeen", "node_id": 1, "picture": "***"},
        "LevelChanged",
    ],
    ids=str,
)
def test_an_event_that_makes_no_sense_is_refused(event):
    with pytest.raises(ValueError, match=r"no |base64"):
        from_values({"scan_s": 1.0, "lifted": False, "events": [event]})
