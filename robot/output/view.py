"""Opening a recording: in a window, in a browser, or by telling the user how."""

import socket
from collections.abc import Callable, Sequence
from pathlib import Path
from urllib.parse import quote

from lemtomap.errors import BadInput
from lemtomap.robot.devices.parts import parts_of
from lemtomap.robot.output.display import has_display
from lemtomap.robot.output.viewer_command import LOOPBACK, end_viewer, start_viewer

RRD_MAGIC = b"RRF"  # Rerun's files begin with RRF and their version, RRF2 today
WEB_PORTS = (9090, 9876)  # Rerun's own, for page and data


def open_recording(path: Path, say: Callable[[str], None], *, web: bool = False) -> None:
    """Show a run's recording and return when its viewer was closed; `say` tells where to look.

    No other machine reaches it, and its ports go with it. Raises BadInput when there is no recording.
    """
    recording = find_recording(path)
    if not web and not has_display():
        raise BadInput(how_to_look(recording))
    shown = [recording] if path.is_file() else parts_of(path / "run.rrd")
    options = ["--port", "auto"]
    if web:
        page, data = free_ports(WEB_PORTS)
        options = ["--serve-web", "--web-viewer-port", str(page), "--port", str(data)]
        say(where_to_look(page, data))
    viewer = start_viewer(*map(str, shown), *options, quiet=web)
    try:
        code = viewer.wait()
    finally:
        end_viewer(viewer)
    if code:
        raise BadInput(f"{recording}: the Rerun viewer ended with code {code}")


def free_ports(wanted: Sequence[int]) -> list[int]:
    """Return as many TCP ports that nobody uses; those wanted, where they are free."""
    held = [_bound(port) for port in wanted]
    ports: list[int] = [each.getsockname()[1] for each in held]
    for each in held:
        each.close()
    return ports


def _bound(port: int) -> socket.socket:
    """Return a socket on this port, or on any other when somebody has it."""
    bound = socket.socket()
    try:
        bound.bind((LOOPBACK, port))
    except OSError:
        bound.bind((LOOPBACK, 0))
    return bound


def where_to_look(page: int, data: int) -> str:
    """Return the link to open, and what to do first on another machine."""
    link = f"http://{LOOPBACK}:{page}/?url={quote(f'rerun+http://{LOOPBACK}:{data}/proxy', safe='')}"
    tunnel = f"ssh -L {page}:{LOOPBACK}:{page} -L {data}:{LOOPBACK}:{data} {socket.gethostname()}"
    return f"open {link}\non another machine, first: {tunnel}\nCtrl-C ends it"


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
