import dataclasses
import math

import pytest
from device_side import kobuki_feedback

from lemtomap.drivers.kobuki.events import KobukiSample
from lemtomap.drivers.kobuki.session import KobukiSession
from lemtomap.robot.motion.docking import Docking, DockingConfig, DockingState
from lemtomap.sim import worlds
from lemtomap.sim.simulator import Simulator


def dock(spawn, config=None, dock_at=(0.35, 5.0, 0.0)):
    """Run a docking in the simulated office; return its last output, the session and the last sample."""
    world = dataclasses.replace(worlds.load("office"), spawn=spawn, dock=dock_at)
    simulator, session, docking = Simulator(world, seed=2), KobukiSession(), Docking(config)
    now_s, output, sample = 0.0, None, None
    while now_s < 250.0 and (output is None or not output.finished):
        now_s += 0.02
        simulator.advance(now_s)
        for event in session.receive(simulator.kobuki.read(), now_s):
            if isinstance(event, KobukiSample):
                sample = event
                output = docking.step(event)
        command = session.tick(now_s)
        simulator.kobuki.write(command + (session.drive(output.v_mps, output.w_radps) if output else b""))
    contacts = simulator.truth().contact_count
    simulator.close()
    return output, sample, contacts


@pytest.mark.parametrize(
    "spawn",
    [(1.5, 5.0, math.pi), (1.5, 4.5, 0.0), (1.2, 5.6, 2.0), (3.0, 4.5, 0.5)],
    ids=["before it, in sight", "to its right", "to its left, near", "far"],
)
def test_finds_the_dock_and_stops_only_when_it_charges(spawn):
    output, sample, _ = dock(spawn)
    assert (output.state, output.v_mps, output.w_radps) == (DockingState.DOCKED, 0.0, 0.0), output.reason
    assert sample.on_dock


def test_gives_up_without_a_dock():
    output, sample, _ = dock((1.5, 5.0, 0.0), DockingConfig(scan_radps=1.5, attempts=1), dock_at=None)
    assert (output.state, output.reason) == (DockingState.FAILED, "no dock in sight all around (1 attempts)")
    assert not sample.on_dock


def test_gives_up_when_its_time_is_over():
    output, _, _ = dock((3.0, 4.5, 0.5), DockingConfig(limit_s=5.0))
    assert (output.state, output.reason) == (DockingState.FAILED, "not docked after 5 s")


def test_never_drives_with_the_charging_cable_in():
    session = KobukiSession()
    frame = bytearray(kobuki_feedback())
    frame[17] = 22
    frame[-1] ^= 22
    (sample,) = [event for event in session.receive(bytes(frame), 0.0) if isinstance(event, KobukiSample)]
    output = Docking().step(sample)
    assert (output.state, output.v_mps, output.w_radps) == (DockingState.FAILED, 0.0, 0.0)
    assert output.reason == "the charging cable is plugged in"
