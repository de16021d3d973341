"""Maps for other programs. Whatever needs absolute poses takes them from one full solve and says so.

Formats: GeoJSON of nav2's route server, tmap2 of LCAS' topological navigation, g2o, GraphML. A file appears
whole or not at all.
"""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import yaml

from lemtomap.errors import BadInput
from lemtomap.se2 import Pose
from lemtomap.topo.graph import Edge
from lemtomap.topo.layout import Layout, lay_out
from lemtomap.topo.store import TopoStore

APPROXIMATE = "poses come from one full graph solve of a relative map and are approximate"
INFLUENCE_M = 0.75  # tmap2: radius of a node's octagon of influence, as in LCAS' own maps
REACHED_M, FACED_RAD = 0.3, 0.1  # tmap2: goal tolerances of LCAS' own maps


def write_geojson(store: TopoStore, path: Path) -> None:
    """Write nav2's route graph. Node and edge IDs share one space there, and edges go one way."""
    layout, names = _laid_out(store, path), _name_of(store)
    shift = max(layout.T_map_node) + 1
    features = [_geojson_node(node_id, T, names) for node_id, T in layout.T_map_node.items()]
    for edge in store.edges():
        ends = (edge.source_id, edge.target_id)
        for way, (start, end) in enumerate((ends, ends[::-1])):
            features.append(_geojson_edge(shift + 2 * edge.edge_id + way, start, end, edge, layout))
    whole = {"type": "FeatureCollection", "name": path.stem, "comment": APPROXIMATE, "features": features}
    _write(path, json.dumps(whole, indent=1))


def _geojson_node(node_id: int, T_map_node: Pose, names: dict[int, str]) -> dict[str, Any]:
    metadata = {"yaw": float(T_map_node[2])} | ({"name": names[node_id]} if node_id in names else {})
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
    """Write a tmap2 topological map."""
    layout, names, label = _laid_out(store, path), _name_of(store), path.stem
    name = {node_id: names.get(node_id, f"Node{node_id}") for node_id in layout.T_map_node}
    leaving: dict[int, list[int]] = {node_id: [] for node_id in layout.T_map_node}
    for edge in store.edges():
        leaving[edge.source_id].append(edge.target_id)
        leaving[edge.target_id].append(edge.source_id)
    still = {"translation": {"x": 0.0, "y": 0.0, "z": 0.0}, "rotation": _quaternion(0.0)}
    whole = {
        "meta": {"last_updated": "1970-01-01_00-00-00", "comment": APPROXIMATE},
        "metric_map": label,
        "name": label,
        "pointset": label,
        "transformation": {"child": "topo_map", "parent": "map", **still},
        "nodes": [
            {
                "meta": {"map": label, "node": name[node_id], "pointset": label},
                "node": _tmap2_node(name[node_id], T, [name[other] for other in leaving[node_id]]),
            }
            for node_id, T in layout.T_map_node.items()
        ],
    }
    _write(path, yaml.safe_dump(whole, sort_keys=False))


def _tmap2_node(name: str, T_map_node: Pose, others: list[str]) -> dict[str, Any]:
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
        "edges": [_tmap2_edge(name, other) for other in others],
    }


def _tmap2_edge(name: str, other: str) -> dict[str, Any]:
    return {
        "action": "NavigateToPose",
        "action_type": "move_base_msgs/MoveBaseGoal",
        "config": [],
        "edge_id": f"{name}_{other}",
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
    """Write a 2D pose graph. An edge that tells nothing of its own carries its share of information: none."""
    layout = lay_out(store)
    lines = [f"# {APPROXIMATE}"]
    for node_id, (x, y, yaw) in layout.T_map_node.items():
        lines.append(f"VERTEX_SE2 {node_id} {x:.9g} {y:.9g} {yaw:.9g}")
    roots = sorted(set(layout.component.values()))
    lines += [f"FIX {node_id}" for node_id in roots]
    upper = np.triu_indices(3)
    for edge in store.edges():
        information = np.linalg.inv(edge.covariance) * edge.share
        numbers = [*edge.T_source_target, *information[upper]]
        lines.append(f"EDGE_SE2 {edge.source_id} {edge.target_id} " + " ".join(f"{v:.12g}" for v in numbers))
    _write(path, "\n".join(lines) + "\n")


def write_graphml(store: TopoStore, path: Path) -> None:
    """Write the graph with the relative poses on its edges: the one export that needs no absolute pose."""
    graph: nx.MultiDiGraph[int] = nx.MultiDiGraph()
    names = _name_of(store)
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
            sigma_x_m=float(sigma[0]),
            sigma_y_m=float(sigma[1]),
            sigma_yaw_rad=float(sigma[2]),
        )
    _write(path, "\n".join(nx.generate_graphml(graph)) + "\n")


def _laid_out(store: TopoStore, path: Path) -> Layout:
    if store.count("edge") == 0:
        raise BadInput(f"{store.path}: a map without edges cannot be written as {path.suffix or path.name}")
    return lay_out(store)


def _name_of(store: TopoStore) -> dict[int, str]:
    return {node_id: name for name, node_id in store.names().items()}


def _write(path: Path, text: str) -> None:
    beside = path.with_name(path.name + ".part")
    try:
        beside.write_text(text, encoding="utf-8")
        beside.replace(path)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise BadInput(f"{path}: cannot be written ({error.strerror})") from None


WRITERS: dict[str, Callable[[TopoStore, Path], None]] = {
    ".geojson": write_geojson,
    ".tmap2": write_tmap2,
    ".g2o": write_g2o,
    ".graphml": write_graphml,
}
"""By file ending; PNG is in `lemtomap.topo.picture`, which needs matplotlib."""
