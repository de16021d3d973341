"""Maps for other programs. Whatever needs absolute poses takes them from one full solve and says so.

Formats: GeoJSON of nav2's route server, tmap2 of LCAS' topological navigation, g2o, GraphML. A file appears
whole or not at all.

What others drive along (GeoJSON, tmap2) holds only ways that are open and known to be free: no edge that
somebody closed, no closure that nobody has driven, which may pass through a wall. GraphML holds all edges and
says of each which it is. In g2o an edge is a measurement and no way; closures belong there, closed edges are
left out, for the format cannot mark them.
"""

import json
import math
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from lemtomap.errors import BadInput
from lemtomap.se2 import Pose
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge
from lemtomap.topo.naming import shown
from lemtomap.topo.whole.layout import Layout, lay_out

APPROXIMATE = "poses come from one full graph solve of a relative map and are approximate"
INFLUENCE_M = 0.75  # tmap2: radius of a node's octagon of influence, as in LCAS' own maps
REACHED_M, FACED_RAD = 0.3, 0.1  # tmap2: goal tolerances of LCAS' own maps
LEAST_SHARE = 1e-6  # g2o: readers such as gtsam refuse an edge without information


def ways(store: TopoStore) -> Iterator[Edge]:
    """Iterate over the edges that a robot may be sent along."""
    return (edge for edge in store.edges() if edge.is_proven and not edge.is_closed)


def left_out(store: TopoStore) -> tuple[int, int]:
    """Return how many edges are closed by hand, and how many others are closures that nobody has driven."""
    kinds = Counter((edge.is_closed, edge.is_proven) for edge in store.edges())
    return kinds[True, True] + kinds[True, False], kinds[False, False]


Marks = Callable[[int], dict[str, Any]]


def no_marks(_: int) -> dict[str, Any]:
    """Return nothing to say of a node or an edge."""
    return {}


def write_geojson(
    store: TopoStore, path: Path, node_marks: Marks = no_marks, edge_marks: Marks = no_marks
) -> None:
    """Write nav2's route graph. Node and edge IDs share one space there, and edges go one way.

    What `node_marks` and `edge_marks` say of an ID goes into its metadata.
    """
    layout, names = _laid_out(store, path), _shown_names(store)
    shift = max(layout.T_map_node) + 1
    features = [
        _geojson_node(node_id, T, names, node_marks(node_id)) for node_id, T in layout.T_map_node.items()
    ]
    for edge in ways(store):
        ends = (edge.source_id, edge.target_id)
        for way, (start, end) in enumerate((ends, ends[::-1])):
            feature = _geojson_edge(shift + 2 * edge.edge_id + way, start, end, edge, layout)
            feature["properties"]["metadata"] |= edge_marks(edge.edge_id)
            features.append(feature)
    label = {"type": "FeatureCollection", "name": shown(path.stem), "comment": APPROXIMATE}
    whole = {**label, "features": features}
    _write(path, json.dumps(whole, indent=1))


def _geojson_node(
    node_id: int, T_map_node: Pose, names: dict[int, str], marks: dict[str, Any]
) -> dict[str, Any]:
    metadata = {"yaw": float(T_map_node[2])} | ({"name": names[node_id]} if node_id in names else {}) | marks
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [float(T_map_node[0]), float(T_map_node[1])]},
        "properties": {"id": node_id, "frame": "map", "metadata": metadata},
    }


def _geojson_edge(number: int, start: int, end: int, edge: Edge, layout: Layout) -> dict[str, Any]:
    line = [[float(v) for v in layout.T_map_node[node_id][:2]] for node_id in (start, end)]
    metadata: dict[str, Any] = {"class": str(edge.type)}
    if edge.time_s is not None:
        metadata["abs_time_taken"] = edge.time_s
    return {
        "type": "Feature",
        "geometry": {"type": "MultiLineString", "coordinates": [line]},
        "properties": {
            "id": number,
            "startid": start,
            "endid": end,
            "cost": edge.length_m,
            "metadata": metadata,
        },
    }


def write_tmap2(store: TopoStore, path: Path) -> None:
    """Write a tmap2 topological map. Names and edge IDs are unique there, and one edge joins two nodes."""
    layout, label = _laid_out(store, path), shown(path.stem)
    name, taken = _labels(store, list(layout.T_map_node)), set[str]()
    leaving: dict[int, dict[int, None]] = {node_id: {} for node_id in layout.T_map_node}
    for edge in ways(store):
        leaving[edge.source_id][edge.target_id] = None
        leaving[edge.target_id][edge.source_id] = None
    still = {"translation": {"x": 0.0, "y": 0.0, "z": 0.0}, "rotation": _quaternion(0.0)}
    nodes = []
    for node_id, T_map_node in layout.T_map_node.items():
        own, others = name[node_id], [name[other] for other in leaving[node_id]]
        ways_to = {other: _unlike(f"{own}_{other}", taken) for other in others}
        meta = {"map": label, "node": own, "pointset": label}
        nodes.append({"meta": meta, "node": _tmap2_node(own, T_map_node, ways_to)})
    whole = {
        "meta": {"last_updated": "1970-01-01_00-00-00", "comment": APPROXIMATE},
        "metric_map": label,
        "name": label,
        "pointset": label,
        "transformation": {"child": "topo_map", "parent": "map", **still},
        "nodes": nodes,
    }
    _write(path, yaml.safe_dump(whole, sort_keys=False))


def _tmap2_node(name: str, T_map_node: Pose, ways_to: dict[str, str]) -> dict[str, Any]:
    corners = [math.pi / 8 + k * math.pi / 4 for k in range(8)]
    return {
        "name": name,
        "parent_frame": "map",
        "pose": {
            "position": {"x": float(T_map_node[0]), "y": float(T_map_node[1]), "z": 0.0},
            "orientation": _quaternion(float(T_map_node[2])),
        },
        "localise_by_topic": "",
        "properties": {"xy_goal_tolerance": REACHED_M, "yaw_goal_tolerance": FACED_RAD},
        "restrictions_planning": "True",
        "restrictions_runtime": "True",
        "verts": [{"x": INFLUENCE_M * math.cos(a), "y": INFLUENCE_M * math.sin(a)} for a in corners],
        "edges": [_tmap2_edge(edge_id, other) for other, edge_id in ways_to.items()],
    }


def _tmap2_edge(edge_id: str, other: str) -> dict[str, Any]:
    return {
        "action": "NavigateToPose",
        "action_type": "move_base_msgs/MoveBaseGoal",
        "config": [],
        "edge_id": edge_id,
        "fail_policy": "fail",
        "fluid_navigation": True,
        "goal": {"target_pose": {"header": {"frame_id": "$node.parent_frame"}, "pose": "$node.pose"}},
        "node": other,
        "recovery_behaviours_config": "",
        "restrictions_planning": "True",
        "restrictions_runtime": "True",
    }


def _quaternion(yaw_rad: float) -> dict[str, float]:
    return {"w": math.cos(0.5 * yaw_rad), "x": 0.0, "y": 0.0, "z": math.sin(0.5 * yaw_rad)}


def write_g2o(store: TopoStore, path: Path) -> None:
    """Write a 2D pose graph. An edge that tells nothing of its own carries next to no information.

    Nothing but vertices and edges: at a comment, or a vertex to be fixed, gtsam forgets all edges.
    """
    layout = lay_out(store)
    lines = []
    for node_id, (x, y, yaw) in layout.T_map_node.items():
        lines.append(f"VERTEX_SE2 {node_id} {x:.9g} {y:.9g} {yaw:.9g}")
    upper = np.triu_indices(3)
    for edge in store.edges():
        if edge.is_closed:
            continue
        information = np.linalg.inv(edge.covariance) * max(edge.share, LEAST_SHARE)
        numbers = [*edge.T_source_target, *information[upper]]
        lines.append(f"EDGE_SE2 {edge.source_id} {edge.target_id} " + " ".join(f"{v:.12g}" for v in numbers))
    _write(path, "\n".join(lines) + "\n")


def write_graphml(store: TopoStore, path: Path) -> None:
    """Write the graph with the relative poses on its edges: the one export that needs no absolute pose."""
    import networkx as nx  # noqa: PLC0415 - half a second that no other format waits for

    graph: nx.MultiDiGraph[int] = nx.MultiDiGraph()
    names = _shown_names(store)
    for node in store.nodes():
        graph.add_node(node.node_id, name=names.get(node.node_id, ""), level=node.level, area=node.area_id)
    for edge in store.edges():
        x, y, yaw = (float(v) for v in edge.T_source_target)
        sigma = np.sqrt(np.diag(edge.covariance))
        graph.add_edge(
            edge.source_id,
            edge.target_id,
            key=edge.edge_id,
            type=str(edge.type),
            x_m=x,
            y_m=y,
            yaw_rad=yaw,
            length_m=edge.length_m,
            time_s=edge.expected_time_s,
            closed=edge.is_closed,
            proven=edge.is_proven,
            sigma_x_m=float(sigma[0]),
            sigma_y_m=float(sigma[1]),
            sigma_yaw_rad=float(sigma[2]),
        )
    _write(path, "\n".join(nx.generate_graphml(graph)) + "\n")


def _laid_out(store: TopoStore, path: Path) -> Layout:
    kind = path.suffix or path.name
    if store.count("edge") == 0:
        raise BadInput(f"{store.path}: a map without edges cannot be written as {kind}")
    if not any(ways(store)):
        raise BadInput(f"{store.path}: a map without an open way cannot be written as {kind}")
    return lay_out(store)


def _shown_names(store: TopoStore) -> dict[int, str]:
    return {node_id: shown(name) for name, node_id in store.names().items()}


def _labels(store: TopoStore, node_ids: list[int]) -> dict[int, str]:
    """Return a name for every node, no two alike: its own, else `Node` and its number."""
    names, taken = _shown_names(store), set[str]()
    named_first = sorted(node_ids, key=lambda node_id: node_id not in names)
    return {node_id: _unlike(names.get(node_id, f"Node{node_id}"), taken) for node_id in named_first}


def _unlike(wanted: str, taken: set[str]) -> str:
    """Return a text like the wanted one and unlike those taken, among which it is from now on."""
    number, text = 1, wanted
    while text in taken:
        number += 1
        text = f"{wanted}_{number}"
    taken.add(text)
    return text


def _write(path: Path, text: str) -> None:
    write_whole(path, text.encode("utf-8"))


def write_whole(path: Path, data: bytes) -> None:
    """Write a file so that it is there whole or not at all. Raises BadInput when it cannot be written."""
    beside = path.with_name(f".{path.name}.part")
    try:
        beside.write_bytes(data)
        beside.replace(path)
    except OSError as error:
        with suppress(OSError):
            beside.unlink(missing_ok=True)
        raise BadInput(f"{path}: cannot be written ({error.strerror})") from None


WRITERS: dict[str, Callable[[TopoStore, Path], None]] = {
    ".geojson": write_geojson,
    ".tmap2": write_tmap2,
    ".g2o": write_g2o,
    ".graphml": write_graphml,
}
"""By file ending; PNG is in `lemtomap.topo.whole.picture`, which needs matplotlib."""
