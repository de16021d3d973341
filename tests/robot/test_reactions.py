"""What the robot does, shows and says when something happens to it: the base step and a simulated robot."""

from dataclasses import dataclass, field, replace
from itertools import pairwise

import pytest

from lemtomap.drivers.kobuki.commands import Led, Tune
from lemtomap.nav.types import NavOutput, NavState
from lemtomap.robot.base import BaseStep
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.devices.indicators import (
    Condition,
    Indicators,
    Light,
    Play,
    signal_bytes,
)
from lemtomap.robot.devices.recording import HOKUYO, KOBUKI
from lemtomap.robot.devices.wire import RecordedHokuyoSession, RecordedKobukiSession, Wire
from lemtomap.robot.exchange import Exchange
from lemtomap.robot.motion.safety import Reason
from lemtomap.sim import worlds
from lemtomap.sim.base import BaseConfig, SimulatedBattery
from lemtomap.sim.errors import Unplugged
from lemtomap.sim.simulator import SimConfig, Simulator
from lemtomap.types import Twist


def ignore(_):
    """Keep nothing."""


@dataclass
class Stage:
    """A robot in the office that somebody drives by hand, and everything it was told and sent."""

    config: SimConfig | None = None
    now_s: float = 0.0
    sent: list = field(default_factory=list)
    signals: list = field(default_factory=list)
    bumper: int = 0
    maps: bool = True
    """False: mapping hangs."""
    plans: bool = True
    """False: navigation hangs."""

    def __post_init__(self):
        self.simulator = Simulator(worlds.load("office"), seed=3, config=self.config)
        self.session = RecordedKobukiSession(ignore)
        self.base = Wire(KOBUKI, self.simulator.kobuki, self.session, ignore, Unplugged)
        self.laser = Wire(HOKUYO, self.simulator.hokuyo, RecordedHokuyoSession(ignore), ignore, Unplugged)
        self.exchange = Exchange()
        self.step = BaseStep(RobotConfig(), self.exchange)
        self.step.gate.permit()
        readings = self.simulator.base._readings
        self.simulator.base._readings = lambda state: replace(readings(state), bumper=self.bumper)

    def drive(self, seconds, twist=None):
        for _ in range(round(50 * seconds)):
            self.now_s = round(self.now_s + 0.02, 9)
            self.simulator.advance(self.now_s)
            told = self.base.poll(self.now_s), self.laser.poll(self.now_s)
            for device in self.base.lost + self.laser.lost:
                self.step.lost(device)
            self.step.take(*told, self.now_s)
            for timed in self.exchange.scans.drain() if self.maps else ():
                self.exchange.mapped.put(timed.scan.stamp_s)
            if self.plans:
                self.exchange.cycle.put(self.now_s)
            if twist is not None:
                self.step.teleop(twist, self.now_s)
            commands = self.step.command(self.now_s)
            self.base.write(self.session.drive(commands.drive.v_mps, commands.drive.w_radps), self.now_s)
            self.sent.append(commands.drive)
            self.signals += commands.signals
        return self.sent[-1]

    def said(self):
        return [note.text for note in self.exchange.notes.drain()]


@pytest.fixture
def driving():
    stage = Stage()
    stage.drive(1.0)
    assert stage.drive(1.5, Twist(0.25, 0.0)).v_mps == pytest.approx(0.25)
    yield stage
    stage.simulator.close()


def test_the_robot_speeds_up_gently_and_stops_when_the_hand_lets_go(driving):
    speeds = [sent.v_mps for sent in driving.sent]
    assert max(b - a for a, b in pairwise(speeds)) <= 0.5 * 0.02 + 1e-9
    stopped = driving.drive(1.2)
    assert (stopped.v_mps, stopped.reason) == (0.0, Reason.COMMAND_TIMEOUT)


def test_a_bump_stops_at_once_backs_off_a_little_and_is_told(driving):
    before = len(driving.sent)
    driving.bumper = 0x02
    driving.drive(0.1, Twist(0.25, 0.0))
    first = next(sent for sent in driving.sent[before:] if sent.reason is Reason.BUMPER)
    assert (first.v_mps, first.w_radps) == (0.0, 0.0)
    driving.bumper = 0
    driving.drive(0.5, Twist(0.25, 0.0))
    assert min(sent.v_mps for sent in driving.sent[before:]) == pytest.approx(-0.1)
    assert driving.drive(2.0, Twist(0.25, 0.0)).v_mps > 0.0
    assert any("center bumper pressed" in text for text in driving.said())
    assert Play(Tune.ERROR) in driving.signals
    assert Light(1, Led.RED) in driving.signals
    assert len(driving.exchange.contacts.drain()) == 1


def test_a_bumper_pressed_by_a_person_moves_nothing():
    stage = Stage()
    stage.drive(1.0)
    stage.bumper = 0x04
    stage.drive(1.0)
    assert {(sent.v_mps, sent.w_radps) for sent in stage.sent} == {(0.0, 0.0)}
    stage.simulator.close()


def test_a_lifted_robot_stops_and_settles_before_it_goes_on(driving):
    driving.simulator.base.lifted = True
    assert driving.drive(0.2, Twist(0.25, 0.0)).reason is Reason.WHEEL_DROP
    driving.simulator.base.lifted = False
    driving.drive(0.3, Twist(0.25, 0.0))
    assert driving.sent[-1].reason is Reason.SETTLING
    assert driving.drive(1.0, Twist(0.25, 0.0)).v_mps > 0.0
    assert any("wheel hangs in the air" in text for text in driving.said())


@pytest.mark.parametrize(
    ("device", "reason"), [("kobuki", Reason.BASE_TIMEOUT), ("hokuyo", Reason.SCAN_TIMEOUT)], ids=str
)
def test_a_pulled_plug_stops_in_one_step_and_a_replug_goes_on(driving, device, reason):
    getattr(driving.simulator, device).unplug()
    stopped = driving.drive(0.02, Twist(0.25, 0.0))
    assert (stopped.v_mps, stopped.reason) == (0.0, reason)
    driving.drive(0.5, Twist(0.25, 0.0))
    getattr(driving.simulator, device).replug()
    assert driving.drive(3.0, Twist(0.25, 0.0)).v_mps > 0.0


def test_an_empty_battery_stops_and_is_seen_and_heard():
    stage = Stage(SimConfig(base=BaseConfig(battery=SimulatedBattery(start_share=0.0, empty_v=13.0))))
    stage.drive(9.0, Twist(0.1, 0.3))
    assert stage.sent[-1].reason is Reason.BATTERY_EMPTY
    assert Light(2, Led.ORANGE) in stage.signals
    assert stage.signals.count(Play(Tune.RECHARGE)) == 1
    assert any("battery" in text for text in stage.said())
    stage.simulator.close()


@pytest.mark.parametrize(
    ("part", "reason"), [("maps", Reason.MAPPING_HANGS), ("plans", Reason.NAVIGATION_HANGS)], ids=str
)
@pytest.mark.parametrize("twist", [Twist(0.25, 0.0), None], ids=["driven", "nobody wants anything"])
def test_a_part_that_hangs_stops_the_robot_and_is_told_shown_and_heard_once(driving, part, reason, twist):
    driving.drive(0.02, twist)
    before, _ = len(driving.sent), driving.said()
    setattr(driving, part, False)
    driving.drive(2.0, twist)
    sent = driving.sent[before:]
    first = next(index for index, each in enumerate(sent) if each.reason is reason)
    assert first * 0.02 <= 0.1 + 0.3  # the next scan comes, or is due, within 0.1 s
    assert {(each.v_mps, each.w_radps, each.reason) for each in sent[first:]} == {(0.0, 0.0, reason)}
    assert driving.said() == [f"stopped: {reason}"]
    assert driving.signals.count(Play(Tune.ERROR)) == 1
    assert driving.signals[-2:] == [Light(1, Led.RED), Play(Tune.ERROR)]
    setattr(driving, part, True)
    assert driving.drive(2.0, Twist(0.25, 0.0)).v_mps > 0.0
    assert driving.said() == [f"cleared: {reason}"]


def test_a_robot_whose_navigation_never_begins_says_so():
    stage = Stage(plans=False)
    assert stage.drive(1.0).reason is Reason.NAVIGATION_HANGS
    stage.simulator.close()


def test_navigation_drives_only_while_it_speaks(driving):
    driving.drive(1.0)
    for _ in range(5):
        driving.exchange.nav_output.put(NavOutput(driving.now_s, Twist(0.2, 0.0), NavState.DRIVING))
        driving.drive(0.1)
    assert driving.sent[-1].v_mps > 0.1
    assert driving.drive(0.7).v_mps == 0.0
    assert Light(1, Led.GREEN) in driving.signals


def test_each_thing_is_said_once_and_not_again_too_soon():
    indicators, well = Indicators(), Condition(Reason.CLEAR, NavState.DRIVING)
    lost = replace(well, lost=True)
    assert Play(Tune.ERROR) in indicators.update(lost, 0.0)
    assert indicators.update(lost, 0.1) == []
    assert indicators.update(well, 0.2) == [Light(2, Led.GREEN)]
    assert indicators.update(lost, 5.0) == [Light(2, Led.RED)]
    indicators.update(well, 6.0)
    assert Play(Tune.ERROR) in indicators.update(lost, 11.0)
    arrived = indicators.update(Condition(Reason.CLEAR, NavState.ARRIVED), 12.0)
    assert Play(Tune.CLEANING_END) in arrived
    indicators.refresh()
    assert len(indicators.update(Condition(Reason.CLEAR, NavState.ARRIVED), 12.1)) == 2


def test_signals_become_bytes():
    session = RecordedKobukiSession(ignore)
    assert signal_bytes(session, Play(Tune.ERROR)) == session.sound(Tune.ERROR)
    assert signal_bytes(session, Light(1, Led.RED)) == session.led(1, Led.RED)
