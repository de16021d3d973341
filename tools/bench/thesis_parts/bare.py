"""What a map takes on disk without its localisation data: V0.5 kept none (table 5-1)."""

import shutil
import tempfile
from contextlib import closing
from pathlib import Path

from lemtomap.topo.file import schema


def bare_bytes(path: Path) -> int:
    """Return the size of a closed map's file once its places are gone; the map itself stays as it is."""
    with tempfile.TemporaryDirectory() as folder:
        bare = Path(folder) / "bare.lemto"
        shutil.copyfile(path, bare)
        with closing(schema.connect(bare)) as connection:
            connection.execute("DELETE FROM place")
            connection.execute("VACUUM")
        return bare.stat().st_size
