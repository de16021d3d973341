"""`lemtomap replay`: a recorded run's bytes through the same drivers once more, mapped anew."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lemtomap.errors import BadLog, BadSetting
from lemtomap.grid import DEFAULT_SLAM
from lemtomap.robot.config import RobotConfig, from_mapping
from lemtomap.robot.devices.recorded import Recording
from lemtomap.robot.devices.replay import replay_map
from lemtomap.robot.exchange import Ended, MissionState
from lemtomap.robot.output.progress import Bar
from lemtomap.robot.runs.run import (
    Run,
    RunPlan,
    Stopped,
    Teller,
)

LOOK_PERIOD_S = 0.1


@dataclass(frozen=True, slots=True)
class Settings:
    """How a recording is mapped."""

    slam: str
    seed: int
    config: RobotConfig
    as_then: bool
    """Just as the run mapped it."""
    why_not: str = ""


def replay_run(
    run: Path, out: Path, bar: Bar, *, slam: str | None = None, seed: int | None = None
) -> dict[str, Any]:
    """Map the recording and leave the usual files; return the summary. Raises BadLog, BadSetting.

    None: as the run did.
    """
    recording = Recording.open(run)
    if out.resolve() in {recording.path.parent.resolve(), recording.path.resolve().parent}:
        raise BadSetting(f"{out}: holds the recording itself; give another --out")
    settings = settings_for(recording, slam, seed)
    plan = RunPlan(
        out=out,
        map_path=out / "map.lemto",
        title=f"replay of {run.name}",
        seed=settings.seed,
        slam=settings.slam,
        config=settings.config,
        replace=True,
        facts={
            "replay_of": str(recording.path),
            "same_map": settings.as_then and recording.whole,
            "missing_s": [[gap.from_s, gap.until_s] for gap in recording.gaps],
        },
    )
    with Run(plan, Teller(bar, recording.ends_s)) as again:
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
                ended_s = replay_map(recording, again.core, watch, as_then=settings.as_then)
            if again.core.mapping.scans == 0:
                missing = recording.told_gaps()
                raise BadLog(f"{recording.path}: holds no scan to map{f'; {missing}' if missing else ''}")
            again.end(Ended(ended_s, MissionState.DONE, _told(recording, settings)))
        except Stopped as stopped:
            again.stopped(ended_s, stopped)
    return again.summary


def settings_for(recording: Recording, slam: str | None, seed: int | None) -> Settings:
    """Return how to map: as the run did, where it says so and nothing else is asked for."""
    about = recording.about
    then_slam, then_seed = about.get("slam"), about.get("seed")
    known = isinstance(then_slam, str) and isinstance(then_seed, int)
    try:
        config = from_mapping(about["config"]) if known else RobotConfig()
    except (BadSetting, KeyError, TypeError, ValueError):
        known, config = False, RobotConfig()
    used_slam = slam if slam is not None else then_slam if known else DEFAULT_SLAM
    used_seed = seed if seed is not None else then_seed if known else 0
    why_not = ""
    if not known:
        why_not = "the recording does not tell the run's settings"
    elif (used_slam, used_seed) != (then_slam, then_seed):
        why_not = "mapped with other settings than the run's"
    elif not about.get("new_map"):
        why_not = "the run went on with a map, the replay begins a new one"
    return Settings(str(used_slam), int(used_seed or 0), config, not why_not, why_not)


def _told(recording: Recording, settings: Settings) -> str:
    """Return what became of it, in a line."""
    missing = recording.told_gaps()
    if missing:
        return f"replayed what is there; {missing}"
    return f"replayed; {settings.why_not}" if settings.why_not else "replayed, scan for scan as in the run"
