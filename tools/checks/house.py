"""The house in figures: rooms, files, arrows, circles, names that stand twice, lines.

    python -m tools.checks.house

Rooms are the folders two levels below `lemtomap`; an arrow is an import from a file of one room into another.
"""

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

import grimp
import networkx as nx

ROOT = Path(__file__).resolve().parents[2]
PARTS = ("drivers", "lemtomap", "robot", "sim")
SAME_IDEA = {"Decoder", "WrongDeviceSeen"}
"""Class names that both drivers have, as both speak of the same thing."""


def room(module: str) -> str:
    """Return the room of a module: `lemtomap.robot.motion.safety` stands in `robot.motion`."""
    below = module.split(".")[1:]
    return ".".join(below[: 2 if len(below) > 2 else 1])


def import_graph() -> "nx.DiGraph[str]":
    """Return the graph of modules, an edge from the importer to the imported."""
    found = grimp.build_graph("lemtomap", cache_dir=None)
    graph: nx.DiGraph[str] = nx.DiGraph()
    graph.add_nodes_from(found.modules)
    for module in found.modules:
        graph.add_edges_from((module, other) for other in found.find_modules_directly_imported_by(module))
    return graph


def circles(graph: "nx.DiGraph[str]") -> list[list[str]]:
    """Return the groups of modules that import one another in a circle."""
    return [sorted(group) for group in nx.strongly_connected_components(graph) if len(group) > 1]


def sources() -> Iterator[Path]:
    """Yield the Python files of the program, each once."""
    for part in PARTS:
        for path in sorted((ROOT / part).rglob("*.py")):
            if part != "lemtomap" or path.relative_to(ROOT).parts[1] not in PARTS:
                yield path


def class_names_twice() -> dict[str, list[str]]:
    """Return the class names that stand in more than one file, with the files."""
    where: defaultdict[str, list[str]] = defaultdict(list)
    for path in sources():
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                where[node.name].append(str(path.relative_to(ROOT)))
    return {name: files for name, files in where.items() if len(files) > 1 and name not in SAME_IDEA}


def main() -> None:
    """Print the figures."""
    graph = import_graph()
    files = Counter(room(module) for module in graph)
    arrows = Counter((room(a), room(b)) for a, b in graph.edges if room(a) != room(b))
    print("| room | files | arrows out | arrows in |\n|---|---|---|---|")
    for name, count in sorted(files.items()):
        out = sum(n for (a, _), n in arrows.items() if a == name)
        into = sum(n for (_, b), n in arrows.items() if b == name)
        print(f"| {name} | {count} | {out} | {into} |")
    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in sources())
    print(f"\nfiles {len(graph)}, arrows {graph.number_of_edges()}, between rooms {arrows.total()}")
    print(f"circles {len(circles(graph))}, class names twice {len(class_names_twice())}, lines {lines}")


if __name__ == "__main__":
    main()
