"""Micro-benches of navigation: routes over large graphs, and the parts of one control cycle."""

import time
from collections.abc import Callable

import numpy as np

from lemtomap import se2
from lemtomap.nav.config import BodyLimits, DwaConfig, RouteConfig
from lemtomap.nav.kernels import fields as kernels
from lemtomap.nav.motion.costmap import Costs
from lemtomap.nav.motion.dwa import choose_twist
from lemtomap.nav.motion.metric import plan_to
from lemtomap.nav.route.network import RouteNetwork
from lemtomap.types import EdgeTable, Twist


def city(nodes: int) -> tuple[EdgeTable, int]:
    """Return a town of corridors with a node each metre and near-neighbour edges, and its node count."""
    rng = np.random.default_rng(0)
    side = int(np.sqrt(nodes))
    ids = np.arange(1, side * side + 1).reshape(side, side)
    across = rng.random((side - 1, side)) < 0.35
    a = np.concatenate([ids[:, :-1].ravel(), ids[:-1][across], ids[:, :-2].ravel()])
    b = np.concatenate([ids[:, 1:].ravel(), ids[1:][across], ids[:, 2:].ravel()])
    length = np.where(b - a == 2, 1.95, 1.0) * rng.uniform(1.0, 1.3, a.size)
    order = np.argsort(np.maximum(a, b), kind="stable")
    length_m, time_s = length[order].astype(np.float32), (length[order] / 0.4).astype(np.float32)
    table = EdgeTable(np.arange(1, a.size + 1), a[order], b[order], length_m, time_s, np.zeros(a.size))
    return table, side**2


def bench_planner() -> None:
    rng = np.random.default_rng(1)
    print("    nodes     edges  load s  first plan ms: median   worst  re-plan ms")
    for nodes in (2_000, 100_000, 1_000_000):
        table, count = city(nodes)
        begin = time.thread_time()
        network = RouteNetwork(table, RouteConfig())
        load_s = time.thread_time() - begin
        network.plan(1, 2, 0.0)  # compile
        pairs = [(1, count), *(tuple(int(i) for i in rng.integers(1, count, 2)) for _ in range(14))]
        first, again = [], []
        for start, goal in pairs:
            begin = time.thread_time()
            route = network.plan(start, goal, 0.0)
            first.append(time.thread_time() - begin)
            shut = {route.edges[min(5, len(route.edges) - 1)].edge_id: 10.0}
            begin = time.thread_time()
            network.plan(start, goal, 0.0, shut)
            again.append(time.thread_time() - begin)
        again = again[1:]  # the first one compiles
        print(
            f"{count:>9} {table.edge_id.size:>9} {load_s:>7.2f} {1e3 * np.median(first):>22.1f} "
            f"{1e3 * max(first):>7.1f} {1e3 * max(again):>11.2f}"
        )


def bench_dwa() -> None:
    rng = np.random.default_rng(0)
    state = np.where(rng.random((400, 400)) < 0.004, 2, 0).astype(np.uint8)
    state[190:210, 190:210] = 0

    def build() -> Costs:
        clearance = kernels.clearance_transform(state, 15.6)
        cost = kernels.traversal_cost(state, clearance, 4.1, 4.0, 2.4, 4.0)
        return Costs(0.0, 0.05, (0.0, 0.0), state, clearance, cost)

    costs = build()
    here = se2.pose(10.0, 10.0, 0.3)
    plan = plan_to(costs, here, (360, 360))
    if plan is None:
        raise SystemExit("the bench's random world has no way: change its seed")
    body, dwa = BodyLimits(), DwaConfig()
    parts: list[tuple[str, Callable[[], object]]] = [
        ("costmap 400 x 400", build),
        ("field and path to a target 11 m away", lambda: plan_to(costs, here, (360, 360))),
        ("DWA", lambda: choose_twist(plan, here, Twist(0.3, 0.2), None, body, dwa)),
    ]
    for name, call in parts:
        call()
        taken = []
        for _ in range(50):
            begin = time.thread_time()
            call()
            taken.append(time.thread_time() - begin)
        print(
            f"{name:40} median {1e3 * np.median(taken):6.2f} ms, p99 {1e3 * np.quantile(taken, 0.99):6.2f} ms"
        )
    print(f"trajectories: {choose_twist(plan, here, Twist(0.3, 0.2), None, body, dwa).tried}")
