"""How this program starts Python once more."""

import sys


def python(*arguments: str) -> list[str]:
    """Return the command line of our own interpreter that takes no module from the working directory.

    `python -m` and `python -c` look there first: a `json.py` in somebody's folder of maps would be run.
    """
    return [sys.executable, "-P", *arguments]
