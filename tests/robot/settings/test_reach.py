"""Every setting reaches its stage: with all of them changed, no part of the robot goes by another value."""

import dataclasses
from collections import defaultdict, deque
from contextlib import suppress
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from lemtomap.pipeline import Mapper
from lemtomap.robot import build, build_map
from lemtomap.robot.baseline import build_metric_core
from lemtomap.robot.config import RobotConfig, value_at
from lemtomap.robot.devices import replay
from lemtomap.robot.missions.missions import parse_mission
from lemtomap.robot.missions.relocalise import Finder
from lemtomap.robot.runs import lockstep, real, run
from lemtomap.robot.runs.runtime import Ports, Runtime
from lemtomap.robot.settings.check import from_mapping
from lemtomap.robot.settings.tree import all_settings, tables, to_mapping
from lemtomap.topo.file.store import TopoStore
from lemtomap.types import GridView

SETTINGS = all_settings()
CLASSES = {table.cls for table in tables() if table.key}


def other_value(index, setting):
    """Return an allowed value that is not the default, and of no other setting where it is a fraction."""
    if setting.kind is bool:
        return not setting.default
    if setting.kind is str:
        return f"/dev/{setting.name}"
    if setting.name == "laser.roll_deg":
        return 180.0
    low, high = setting.allowed.low, setting.allowed.high
    if setting.kind is int:
        return setting.default + 1 if setting.default + 1 <= high else setting.default - 1
    share = 1e-3 + 1e-5 * index
    if setting.default is None:
        return low + share * (high - low)
    nearer = setting.default * (1.0 - share) if setting.default else share
    return nearer if low <= nearer <= high else setting.default + share * (high - setting.default)


CHANGED = {key: other_value(index, setting) for index, (key, setting) in enumerate(SETTINGS.items())}


@pytest.fixture(scope="module")
def config():
    """Return settings of which every one is changed."""
    data = to_mapping(RobotConfig())
    for key, value in CHANGED.items():
        at = data
        for name in key[:-1]:
            at = at[name]
        at[key[-1]] = value
    return from_mapping(data)


def mission_of(text, navigator):
    """Return a mission that has begun."""
    mission = parse_mission(text)
    lost = {"view": SimpleNamespace(lost=True), "graph": None, "output": None, "T_odom_base": None}
    mission.step(SimpleNamespace(navigator=navigator, now_s=0.0, **lost))
    return mission


@pytest.fixture(scope="module")
def stages(config, tmp_path_factory):
    """Return all that is built of the settings: the robot on a new map and on a known one, and the rest."""
    folder, taken = tmp_path_factory.mktemp("reach"), []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "prune", lambda _store, pruning: taken.append(pruning))
        patch.setattr(
            run, "RunFiles", lambda *arguments: taken.append(arguments[-1].viewer) or SimpleNamespace()
        )
        plan = run.RunPlan(folder / "out", folder / "out.lemto", "", 0, "window", config)
        with suppress(RuntimeError), run.Run(plan, SimpleNamespace()) as begun:
            begun.files.close = lambda: None
            raise RuntimeError  # before anything was mapped: then nothing is written
        for name in ("window", "rolling"):
            core = build.build_core(config, folder / "map.lemto", slam=name)
            taken += [core.base, core.mapping, core.navigation]
            core.close()
    navigator = core.navigation.navigator
    grid = GridView(0.0, np.zeros((40, 40), np.int8), 0.05, (-1.0, -1.0))
    metric = build_metric_core(config, grid, (0.0, 0.0, 0.0))
    taken += [metric.base, metric.mapping, metric.navigation, mission_of("explore", navigator)]
    taken += [Finder(navigator.config, 0.0), real.find_ports(config.ports)]
    onlooker = SimpleNamespace(raw=SimpleNamespace(put=None))
    runtime = Runtime(core, Ports(None, None), onlooker)
    taken += [runtime._kobuki, runtime._hokuyo]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(real, "driven_by_hand", lambda *arguments: taken.append(arguments[-1]))
        real._hands(real.RobotOptions("idle", 0.0, config, by_hand=True), runtime)
    return taken


def inside(root):
    """Yield whatever a stage holds, however deep; what it holds of all settings together is no stage."""
    seen, waiting = set(), [root]
    while waiting:
        thing = waiting.pop()
        if id(thing) in seen or isinstance(thing, RobotConfig | type):
            continue
        seen.add(id(thing))
        yield thing
        waiting += held(thing)


def held(thing):
    if isinstance(thing, dict):
        return list(thing.values())
    if isinstance(thing, list | tuple | set | frozenset | deque):
        return list(thing)
    if isinstance(thing, np.ndarray):
        return thing.ravel().tolist() if thing.size <= 3 else []
    if isinstance(thing, partial):
        return [thing.func, thing.args, thing.keywords]
    closure = [cell.cell_contents for cell in getattr(thing, "__closure__", None) or ()]
    owner = [thing.__self__] if hasattr(thing, "__self__") else []
    slots = [name for cls in type(thing).__mro__ for name in getattr(cls, "__slots__", ())]
    if not type(thing).__module__.startswith("lemtomap"):
        return closure + owner
    return (
        closure + owner + [getattr(thing, name, None) for name in {*slots, *getattr(thing, "__dict__", ())}]
    )


@pytest.fixture(scope="module")
def found(stages):
    """Return what stands in the stages: settings by their class, and single values."""
    tables_of, values = defaultdict(list), set()
    for stage in stages:
        for thing in inside(stage):
            if type(thing) in CLASSES:
                tables_of[type(thing)].append(thing)
            elif isinstance(thing, int | float | str):
                values.add(thing)
    return tables_of, values


def test_all_settings_differ_from_their_defaults(config):
    kept = [key for key in SETTINGS if value_at(config, key) == value_at(RobotConfig(), key)]
    assert kept == []


@pytest.mark.parametrize("key", SETTINGS, ids=".".join)
def test_a_changed_setting_reaches_its_stage(found, key):
    tables_of, values = found
    setting, value = SETTINGS[key], CHANGED[key]
    held_there = [getattr(table, key[-1]) for table in tables_of[setting.table]]
    assert value in held_there or value in values


def test_no_stage_goes_by_other_settings_than_those_given(found, config):
    given = defaultdict(list)
    for table in tables():
        given[table.cls].append(value_at(config, table.key))
    strays = [thing for things in found[0].values() for thing in things if thing not in given[type(thing)]]
    assert strays == []


def test_the_map_file_is_kept_as_the_settings_say(config, tmp_path):
    core = build.build_core(config, tmp_path / "map.lemto")
    store = core.mapping.mapper.topo.store
    assert store.commit_every_s == config.topo.commit_every_s
    core.close()


def test_a_program_s_mapper_goes_by_the_settings_it_is_given(config, tmp_path):
    mapper = Mapper.open(tmp_path / "map.lemto", slam=config.slam, topo=config.topo, loops=config.loops)
    held_there = {type(thing): thing for thing in inside(mapper) if dataclasses.is_dataclass(thing)}
    for given in (config.slam, config.topo, config.loops):
        assert held_there[type(given)] == given
    mapper.close()


def test_a_recorded_log_is_mapped_by_the_settings_it_is_given(config, tmp_path):
    store = TopoStore.create(tmp_path / "map.lemto")
    topo = build_map.build_topo("window", config, store)
    held_there = {type(thing): thing for thing in inside(topo) if dataclasses.is_dataclass(thing)}
    assert held_there[type(config.topo)] == config.topo
    assert held_there[type(config.loops)] == config.loops
    topo.close()


@pytest.mark.parametrize("build_robot", [build.build_core, build_metric_core], ids=["mapping", "metric"])
def test_sessions_in_lockstep_and_of_a_replay_go_by_the_settings(config, tmp_path, monkeypatch, build_robot):
    grid = GridView(0.0, np.zeros((40, 40), np.int8), 0.05, (-1.0, -1.0))
    arguments = (tmp_path / "map.lemto",) if build_robot is build.build_core else (grid, (0.0, 0.0, 0.0))
    core, taken = build_robot(config, *arguments), []

    def session(*given):
        taken.append(given[-1])
        return SimpleNamespace(reopened=lambda: None)

    for module, name in ((lockstep, "Recorded{}Session"), (replay, "{}Session")):
        monkeypatch.setattr(module, name.format("Kobuki"), session)
        monkeypatch.setattr(module, name.format("Hokuyo"), session)
    monkeypatch.setattr(lockstep, "Wire", lambda *_: None)
    with suppress(AttributeError):
        lockstep.run_lockstep(SimpleNamespace(kobuki=None, hokuyo=None), core, None, 0.0)
    replay.replay_map(SimpleNamespace(entries=lambda: iter(())), core, as_then=False)
    assert taken == [config.devices.kobuki, config.devices.hokuyo] * 2
    core.close()
