"""Text and YAML files from strangers: read within limits, refused in one line."""

import os
import stat
from pathlib import Path
from typing import Any

import yaml

from lemtomap.sim.errors import BadWorld

MAX_BYTES = 1 << 20
MAX_DEPTH = 20  # tables and lists within one another
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def require_file(path: Path) -> None:
    """Raise BadWorld unless the path leads to a plain file; a pipe or a device could be read for ever."""
    try:
        mode = os.stat(path).st_mode  # noqa: PTH116 - Path.stat hides what a bad name is
    except FileNotFoundError as error:
        raise BadWorld(f"{path}: no such file") from error
    except (OSError, ValueError) as error:
        raise BadWorld(f"{path}: cannot be read ({_reason(error)})") from error
    if not stat.S_ISREG(mode):
        raise BadWorld(f"{path}: not a file")


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file. Raises BadWorld."""
    require_file(path)
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise BadWorld(f"{path}: larger than {MAX_BYTES >> 20} MB")
        return data.decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise BadWorld(f"{path}: not a readable text file ({_reason(error)})") from error


def read_yaml(path: Path) -> Any:
    """Return what a YAML file holds. Raises BadWorld, also for aliases: a few lines of them hold billions."""
    text = read_text(path)
    try:
        _check_shape(path, text)
        return yaml.load(text, Loader=LOADER)  # noqa: S506 - either is a safe one
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: as 30 February is
        raise BadWorld(f"{path}: not a readable YAML file ({_reason(error)})") from error


def _check_shape(path: Path, text: str) -> None:
    depth = 0
    for event in yaml.parse(text, Loader=LOADER):
        if isinstance(event, yaml.AliasEvent):
            raise BadWorld(f"{path}: a plan needs no aliases (*{event.anchor})")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > MAX_DEPTH:
            raise BadWorld(f"{path}: more than {MAX_DEPTH} levels deep")


def _reason(error: Exception) -> str:
    return error.strerror or str(error) if isinstance(error, OSError) else str(error)
