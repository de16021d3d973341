"""Is there a screen?"""

import os
import sys


def has_display() -> bool:
    """Return True if a window could be opened here."""
    return sys.platform == "darwin" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
