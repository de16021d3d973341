"""`lemtomap replay`: a recorded run's bytes through the same drivers once more, mapped anew."""

from pathlib import Path
from typing import Any

from lemtomap.errors import BadSetting
from robot.config import RobotConfig
from robot.exchange import Ended, MissionState
from robot.progress import Bar
from robot.recording import find_recording, read_entries
from robot.replay import replay_map
from robot.run import Run, RunPlan, Stopped, Teller

LOOK_PERIOD_S = 0.1


def replay_run(run: Path, out: Path, bar: Bar, *, slam: str, seed: int) -> dict[str, Any]:
    """Map the recording and leave the usual files; return the summary. Raises BadLog, BadSetting."""
    recording = find_recording(run)
    if out.resolve() in {recording.parent.resolve(), recording.resolve().parent}:
        raise BadSetting(f"{out}: holds the recording itself; give another --out")
    end_s = max(entry.now_s for entry in read_entries(recording))
    plan = RunPlan(
        out=out,
        map_path=out / "map.lemto",
        title=f"replay of {run.name}",
        seed=seed,
        slam=slam,
        config=RobotConfig(),
        replace=True,
        facts={"replay_of": str(recording)},
    )
    with Run(plan, Teller(bar, end_s)) as again:
        look_at_s = ended_s = 0.0

        def watch(now_s: float) -> None:
            nonlocal look_at_s, ended_s
            again.check()
            ended_s = now_s
            if now_s >= look_at_s:
                look_at_s = now_s + LOOK_PERIOD_S
                again.files.look(now_s)

        try:
            with again.until_asked():
                ended_s = replay_map(recording, again.core, watch)
            again.end(Ended(ended_s, MissionState.DONE, "replayed"))
        except Stopped as stopped:
            again.stopped(ended_s, stopped)
    return again.summary
