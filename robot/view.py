"""Opening a recording: in a window, in a browser, or by telling the user how."""

import subprocess
import sys
from pathlib import Path

from lemtomap.errors import BadInput
from robot.display import has_display
from robot.parts import parts_of

RRD_MAGIC = b"RRF"  # Rerun's files begin with RRF and their version, RRF2 today


def open_recording(path: Path, *, web: bool = False) -> None:
    """Show a run's recording and return when its viewer was closed; raises BadInput when there is none."""
    recording = find_recording(path)
    if not web and not has_display():
        raise BadInput(how_to_look(recording))
    shown = [recording] if path.is_file() else parts_of(path / "run.rrd")
    command = [sys.executable, "-m", "rerun", *map(str, shown), *(["--serve-web"] if web else [])]
    code = subprocess.run(command, check=False).returncode  # noqa: S603 - our own interpreter, a checked path
    if code:
        raise BadInput(f"{recording}: the Rerun viewer ended with code {code}")


def find_recording(path: Path) -> Path:
    """Return the recording meant by a folder or file; raises BadInput with the reason."""
    recording = path
    if path.is_dir():
        parts = parts_of(path / "run.rrd")
        recording = parts[0] if parts else path / "run.rrd"
    if not recording.exists():
        raise BadInput(f"{recording}: no such recording")
    with recording.open("rb") as file:
        if not file.read(len(RRD_MAGIC)).startswith(RRD_MAGIC):
            raise BadInput(f"{recording}: not a Rerun recording (.rrd)")
    return recording


def how_to_look(recording: Path) -> str:
    """Return what to tell somebody who sits at a machine without a display."""
    return (
        f"no display here; look at it with 'lemtomap view {recording} --web', "
        f"or copy it to your desktop: pip install rerun-sdk, rerun {recording.name}"
    )
