"""Draw docs/urg04lx.png: the maps of the rover's logs, side by side.

python tools/truth/urg04lx_picture.py ../shared/data/urg04lx/exp1.dat.xz ../shared/data/urg04lx/exp2.dat.xz
"""

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

from PIL import Image

from lemtomap.robot.output.progress import progress_bar
from lemtomap.robot.runs.map_log import MapLogOptions, map_log

WHOLE_MAP_PX = (0, 40, 1240, 1160)  # where the overview, 1800 x 1200, shows the whole map
HEIGHT_PX = 600
PICTURE = Path(__file__).parents[1] / "docs" / "urg04lx.png"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("logs", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, default=PICTURE)
    options = parser.parse_args(arguments)
    parts = [_part(log) for log in options.logs]
    picture = Image.new("RGB", (sum(part.width for part in parts), HEIGHT_PX), "white")
    left = 0
    for part in parts:
        picture.paste(part, (left, 0))
        left += part.width
    picture.quantize(64).save(options.out, optimize=True)
    return 0


def _part(log: Path) -> Image.Image:
    """Map a log; return the picture of its whole map."""
    with tempfile.TemporaryDirectory() as folder, progress_bar(log.name) as bar:
        out = Path(folder) / "out"
        print(map_log(MapLogOptions(log, out), bar))
        with Image.open(out / "overview.png") as overview:
            part = overview.convert("RGB").crop(WHOLE_MAP_PX)
    return part.resize((round(part.width * HEIGHT_PX / part.height), HEIGHT_PX), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    raise SystemExit(main())
