"""How this program starts Python once more."""

import sys
from pathlib import Path

import lemtomap

ROOT = Path(lemtomap.__file__).resolve().parent.parent
"""What holds the package: a checkout, or the environment it is installed in."""

RUN_MODULE = (
    "import runpy, sys; sys.path.append(sys.argv[1]); del sys.argv[:2]; "
    "runpy.run_module(sys.argv[0], run_name='__main__', alter_sys=True)"
)


def python(*arguments: str) -> list[str]:
    """Return the command line of our own interpreter that takes no module from the working directory.

    `python -m` and `python -c` look there first: a `json.py` in somebody's folder of maps would be run. After
    all else this program's own folder is looked through, so that a bare checkout finds its modules too.
    """
    if arguments[:1] == ("-m",):
        return [sys.executable, "-P", "-c", RUN_MODULE, str(ROOT), *arguments[1:]]
    return [sys.executable, "-P", *arguments]
