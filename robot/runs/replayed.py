"""`lemtomap replay`: a recorded run's bytes through the same drivers once more, mapped anew."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lemtomap.errors import BadLog, BadSetting
from lemtomap.grid import DEFAULT_SLAM
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.devices.recorded import Recording
from lemtomap.robot.devices.replay import replay_map
from lemtomap.robot.exchange import Ended, MissionState
from lemtomap.robot.output.onlooker import LOOK_PERIOD_S
from lemtomap.robot.output.progress import Bar
from lemtomap.robot.runs.run import (
    Run,
    RunPlan,
    Stopped,
    Teller,
)
from lemtomap.robot.settings.check import from_mapping
from lemtomap.robot.settings.read import read_settings

UNTOLD = "the recording does not tell the run's settings"


@dataclass(frozen=True, slots=True)
class Changes:
    """What shall be otherwise than in the run; None: as it was."""

    slam: str | None = None
    seed: int | None = None
    file: Path | None = None
    """Settings instead of those that the run recorded, ..."""
    orders: tuple[str, ...] = ()
    """... and single ones over either of them, `KEY=VALUE`."""


@dataclass(frozen=True, slots=True)
class ReplaySettings:
    """How a recording is mapped."""

    slam: str
    seed: int
    config: RobotConfig
    as_then: bool
    """Just as the run mapped it."""
    why_not: str = ""


def replay_run(run: Path, out: Path, bar: Bar, changes: Changes | None = None) -> dict[str, Any]:
    """Map the recording and leave the usual files; return the summary. Raises BadLog, BadSetting.

    It is mapped as in the run, with the settings recorded there, but for `changes`.
    """
    recording = Recording.open(run)
    if out.resolve() in {recording.path.parent.resolve(), recording.path.resolve().parent}:
        raise BadSetting(f"{out}: holds the recording itself; give another --out")
    settings = settings_for(recording, changes)
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


def settings_for(recording: Recording, changes: Changes | None = None) -> ReplaySettings:
    """Return how to map: as the run did, where it says so and nothing else is asked. Raises BadSetting."""
    asked, about = changes or Changes(), recording.about
    then_slam, then_seed = about.get("slam"), about.get("seed")
    then, unknown = _recorded_config(about)
    if not (isinstance(then_slam, str) and isinstance(then_seed, int)):
        then_slam, then_seed, then, unknown = DEFAULT_SLAM, 0, RobotConfig(), UNTOLD
    slam = asked.slam if asked.slam is not None else then_slam
    seed = asked.seed if asked.seed is not None else then_seed
    config = read_settings(asked.file, asked.orders, base=then).config
    why_not = unknown
    if asked.file is not None:
        why_not = f"with the settings of {asked.file}, not the run's own"
    elif (slam, seed, config) != (then_slam, then_seed, then):
        why_not = "mapped with other settings than the run's"
    elif not why_not and not about.get("new_map"):
        why_not = "the run went on with a map, the replay begins a new one"
    return ReplaySettings(slam, seed, config, not why_not, why_not)


def _recorded_config(about: Mapping[str, Any]) -> tuple[RobotConfig, str]:
    """Return the settings that the run recorded, else the defaults and why."""
    try:
        return from_mapping(about["config"]), ""
    except KeyError:
        return RobotConfig(), UNTOLD
    except BadSetting as error:  # of another version
        return RobotConfig(), f"with the defaults, for the run's settings cannot be used: {error}"


def _told(recording: Recording, settings: ReplaySettings) -> str:
    """Return what became of it, in a line."""
    missing = recording.told_gaps()
    if missing:
        return f"replayed what is there; {missing}"
    return f"replayed; {settings.why_not}" if settings.why_not else "replayed, scan for scan as in the run"
