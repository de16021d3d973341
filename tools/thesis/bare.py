"""What a map takes on disk without its localisation data: V0.5 kept none (table 5-1)."""

import shutil
import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path


def bare_bytes(path: Path) -> int:
    """Return the size of a closed map's file once its places are gone; the map itself stays as it is."""
    with tempfile.TemporaryDirectory() as folder:
        bare = Path(folder) / "bare.lemto"
        shutil.copyfile(path, bare)
        with closing(sqlite3.connect(bare, isolation_level=None)) as connection:
            connection.execute("DELETE FROM place")
            connection.execute("VACUUM")
        return bare.stat().st_size
