"""What a map costs as the drive grows from 100 m to 1,000 km: nodes against update, memory, file, first plan.

    lemtomap bench scale [--to-km 1000] [--out runs/scale]

A synthetic drive without rays: a meander of lanes through a free hall, really driven and timed at each size;
the stretches between are laid into the file in bulk (tools/bench/topo.py). The first plan is that of a robot
that just opened the map, from one end to the other: reading the edges and the search are told apart. Each
column is fitted with a power of the number of nodes over the last two decades: 0 is flat, 1 is in proportion.
Leaves scale.md, scale.json and scale.png; a size that is done is not done again.
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from lemtomap.nav.config import RouteConfig
from lemtomap.nav.route.network import RouteNetwork
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file import schema
from lemtomap.topo.file.reader import TopoReader
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.mapper import TopoMapper
from tools.bench.parts.mapping_runs import table
from tools.bench.parts.measuring import resident_mb
from tools.bench.topo import (
    STEP_M,
    TIMED,
    Driver,
    grown,
    meander,
    stand_on,
)

NODE_M = 1.05  # of the way, between two nodes
KM = (0.1, 1.0, 10.0, 100.0, 1000.0)
COLUMNS = {
    "ms_per_update": "an update, ms",
    "resident_mb": "memory of the mapper, MB",
    "file_mb": "map file, MB",
    "read_s": "first plan: reading the edges, s",
    "plan_s": "first plan: the search, s",
    "open_s": "opening the map to go on, s",
}


@dataclass(frozen=True, slots=True)
class Size:
    """One length of the drive."""

    km: float
    nodes: int
    ms_per_update: float
    """CPU by the thread's clock, median over stretches of 100 updates."""
    resident_mb: float
    file_mb: float
    read_s: float
    plan_s: float
    open_s: float
    """Wall time; NaN for the first size, which was never closed."""


def measure(km: float, driver: Driver, path: Path, first: bool) -> tuple[Driver, Size]:  # noqa: FBT001
    """Let the map grow to a length, drive on, and measure."""
    target, open_s = round(km * 1000.0 / NODE_M), float("nan")
    if not first:
        driver, open_s = grown(driver, path, target, TopoConfig(durable=False), np.random.default_rng(target))
    updates = min(TIMED, max(200, round(km * 1000.0 / STEP_M)))
    ms = 1e3 * driver.drive(updates)
    driver.mapper.store.commit()
    resident = resident_mb()
    nodes = driver.mapper.store.count("node")
    read_s, plan_s = first_plan(path, nodes)
    return driver, Size(km, nodes, ms, resident, _bytes(path) / 1e6, read_s, plan_s, open_s)


def _bytes(path: Path) -> int:
    """Return the size of the map once everything written has been folded into it, as on closing."""
    with closing(schema.connect(path)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    return path.stat().st_size


def first_plan(path: Path, nodes: int) -> tuple[float, float]:
    """Return CPU seconds of reading all edges and of the search from the first node to the last."""
    with TopoReader(path) as reader:
        begun = time.thread_time()
        network = RouteNetwork(reader.edge_table(), RouteConfig())
        read = time.thread_time()
        network.plan(1, nodes, 0.0)
        return read - begun, time.thread_time() - read


def exponent(sizes: Sequence[Size], column: str) -> float:
    """Return the power of the number of nodes by which a column grows over the last two decades."""
    late = [size for size in sizes if size.nodes >= sizes[-1].nodes / 120.0]
    pairs = [(size.nodes, getattr(size, column)) for size in late if getattr(size, column) > 0.0]
    if len(pairs) < 2:
        return float("nan")
    nodes, values = np.log(np.array(pairs, dtype=np.float64)).T
    return float(np.polyfit(nodes, values, 1)[0])


def text_of(sizes: Sequence[Size]) -> str:
    """Return the table."""
    rows = [[f"{s.km:g}", f"{s.nodes:,}", *(f"{getattr(s, key):.4g}" for key in COLUMNS)] for s in sizes]
    rows.append(["grows as nodes to the power", "", *(f"{exponent(sizes, key):.2f}" for key in COLUMNS)])
    return table(["drive, km", "nodes", *COLUMNS.values()], rows)


def draw(sizes: Sequence[Size], path: Path) -> None:
    """Draw each column over the number of nodes, both scales logarithmic."""
    figure = Figure(figsize=(12, 6), dpi=100, layout="constrained")
    for axes, (key, title) in zip(figure.subplots(2, 3).flat, COLUMNS.items(), strict=True):
        axes.loglog([s.nodes for s in sizes], [getattr(s, key) for s in sizes], "o-", color="#1d5fa8")
        axes.set_title(f"{title}: nodes^{exponent(sizes, key):.2f}", fontsize=9)
        axes.set_ylim(*np.array(axes.get_ylim()) * np.array([0.5, 2.0]))
        axes.grid(visible=True, color="#ddd")
    figure.savefig(path)


def run(most_km: float, out: Path) -> list[Size]:
    """Do every size that is not done yet."""
    out.mkdir(parents=True, exist_ok=True)
    path, done = out / "scale.lemto", out / "scale.json"
    sizes = [Size(**each) for each in json.loads(done.read_text())] if done.exists() else []
    todo = [km for km in KM if km <= most_km and km not in {size.km for size in sizes}]
    if not todo:
        return sizes
    if not sizes or not path.exists():
        sizes = []
        todo = [km for km in KM if km <= most_km]
        for old in out.glob("scale.lemto*"):
            old.unlink()
    with tempfile.TemporaryDirectory() as folder:  # compiles
        spare = Path(folder) / "spare.lemto"
        driver = Driver(TopoMapper(TopoConfig(durable=False), TopoStore.create(spare, durable=False)))
        driver.drive(300)
        first_plan(spare, driver.mapper.store.count("node") - 2)  # the newest may not be in the file yet
        driver.mapper.close()
    store = TopoStore.open(path, durable=False) if sizes else TopoStore.create(path, durable=False)
    driver = Driver(TopoMapper(TopoConfig(durable=False), store))
    if sizes:
        stand_on(driver.mapper, store.count("node"), 0.0, next(meander()))
    for km in todo:
        begun = time.perf_counter()
        driver, size = measure(km, driver, path, not sizes)
        sizes.append(size)
        done.write_text(json.dumps([asdict(each) for each in sizes], indent=1))
        print(f"{km:g} km, {size.nodes:,} nodes: {time.perf_counter() - begun:.0f} s", file=sys.stderr)
    driver.mapper.close()
    return sizes


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="lemtomap bench scale", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--to-km", type=float, default=KM[-1])
    parser.add_argument("--out", type=Path, default=Path("runs/scale"))
    options = parser.parse_args(arguments)
    if options.to_km < KM[0]:
        print(f"--to-km {options.to_km:g}: at least {KM[0]:g}", file=sys.stderr)
        return 2
    sizes = run(options.to_km, options.out)
    draw(sizes, options.out / "scale.png")
    (options.out / "scale.md").write_text(text_of(sizes) + "\n\n![growth](scale.png)\n")
    print(text_of(sizes))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
