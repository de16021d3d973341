"""Read a map file: `python examples/read_map.py my.lemto` (own_scans.py makes one).

It prints every node with its name, where it lies when the whole map is laid out, and the nodes one edge away
with the metres and the seconds to them. The file is only read, and may be in use.
"""

import sys

import lemtomap
from lemtomap.topo.file.reader import TopoReader
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.whole.layout import lay_out


def main(path: str) -> None:
    """Print what is in the map. Raises BadMap."""
    with TopoStore.view(path) as store, TopoReader(path) as graph:
        called = {node_id: name for name, node_id in store.names().items()}
        layout = lay_out(store)
        for node_id, (x, y, _yaw) in layout.T_map_node.items():
            ways = [
                f"{edge.other_id} ({edge.length_m:.2f} m, {edge.time_s:.1f} s)"
                for edge in graph.edges_of(node_id)
            ]
            print(
                f"node {node_id} {called.get(node_id, '')} at x {x:.2f} m, y {y:.2f} m; to {', '.join(ways)}"
            )


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: read_map.py MAP.lemto")
    try:
        main(sys.argv[1])
    except lemtomap.BadMap as error:
        print(error, file=sys.stderr)
        sys.exit(2)
