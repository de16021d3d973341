"""The udev rules that give both cables stable names and prompt bytes, and their installation."""

import os
import shutil
import subprocess
from pathlib import Path

from lemtomap.errors import BadSetting

RULES = Path(__file__).resolve().parent / "udev" / "60-lemtomap.rules"
FOLDER = Path("/etc/udev/rules.d")
INSTALL = "sudo lemtomap doctor --install-udev"
RELOAD_LIMIT_S = 10.0  # udevadm answers at once, or not at all in a container


def install_udev(folder: Path = FOLDER) -> Path:
    """Copy the rules into udev's folder and let it read them anew; return the file written.

    Raises BadSetting when this user may not, or where there is no udev.
    """
    if not folder.is_dir():
        raise BadSetting(f"{folder}: no such folder; this machine has no udev")
    target = folder / RULES.name
    beside = target.with_name(f".{target.name}.new")
    try:
        shutil.copyfile(RULES, beside)
        beside.chmod(0o644)
        beside.replace(target)
    except PermissionError:
        raise BadSetting(f"{target}: only root may write there: {INSTALL}") from None
    _reload()
    return target


def _reload() -> None:
    """Let udev read its rules and apply them to what is plugged in; else they count from the next start."""
    udevadm = shutil.which("udevadm")
    if udevadm is None or os.geteuid() != 0:
        return
    for words in (["control", "--reload"], ["trigger", "--subsystem-match=tty"]):
        subprocess.run(  # noqa: S603 - the system's own program
            [udevadm, *words], check=False, capture_output=True, timeout=RELOAD_LIMIT_S
        )
