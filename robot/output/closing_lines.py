"""What the user reads when a run is over."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import typer

from lemtomap.errors import LemtomapError
from lemtomap.robot.output.display import has_display
from lemtomap.robot.output.view import how_to_look


class RunFault(LemtomapError):
    """Something beside the mission went wrong in a run; the text is one line that says what and where."""


def conclude(summary: Mapping[str, Any]) -> None:
    """Print how the run went, and end the command with the right code.

    Raises KeyboardInterrupt after an interrupted run, RunFault after a fault, typer.Exit else.
    """
    with suppress(OSError):  # nobody reads any more; the results stand
        typer.echo(told_after_run(summary))
    if summary["interrupted"]:
        raise KeyboardInterrupt
    if summary["faults"]:
        raise RunFault("; ".join(summary["faults"]))
    raise typer.Exit(summary["result"] == "failed")


def told_after_run(summary: Mapping[str, Any]) -> str:
    """Return a few lines: how it went, what it cost, where the results are and how to look at them."""
    out, lines = Path(summary["out"]), [_verdict(summary)]
    if "nodes" in summary:
        contacts = f", {summary['contacts']} contacts" if "contacts" in summary else ""
        lines.append(
            f"{summary['path_m']:.0f} m driven in {summary['run_s']:.0f} s "
            f"({summary['realtime_factor']:.1f}x real time){contacts}; "
            f"{summary['nodes']} nodes, {summary['loop_closures']} loop closures, "
            f"{summary['map_bytes'] / 1000:.0f} kB of map"
        )
        lines.append(f"picture    {out / 'overview.png'}")
        lines.append(f"map        {summary['map']}")
        lines.append(
            f"grid       {out / 'grid.yaml'}   (the window at the end, in the frame of trajectory.tum)"
        )
    recording = out / "run.rrd"
    if not recording.exists():
        return "\n".join(lines)
    if has_display():
        lines.append(f"recording  {recording}   (again: lemtomap view {out})")
    else:
        lines.append(f"recording  {recording}")
        lines.append(how_to_look(recording))
    return "\n".join(lines)


def _verdict(summary: Mapping[str, Any]) -> str:
    """Return how the mission ended, in a line."""
    if summary["result"] == "running":
        return f"stopped after {summary['run_s']:.0f} s, while: {summary['result_text']}"
    return ": ".join(part for part in (summary["result"], summary["result_text"]) if part)
