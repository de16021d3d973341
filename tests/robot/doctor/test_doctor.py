"""Every fault is named with its cure: simulated devices tell, the doctor judges."""

import os
from dataclasses import replace

import numpy as np
import pytest

from lemtomap.drivers.hokuyo.events import LaserFault, LaserScan, WrongDeviceSeen
from lemtomap.drivers.hokuyo.session import HokuyoSession
from lemtomap.drivers.kobuki.events import BaseInfo, Compatibility, KobukiSample
from lemtomap.drivers.kobuki.packets import Bumper, Version
from lemtomap.drivers.kobuki.session import KobukiSession
from lemtomap.robot.devices import ports
from lemtomap.robot.devices.recording import HOKUYO, KOBUKI
from lemtomap.robot.devices.wire import Wire
from lemtomap.robot.doctor import examine as doctor
from lemtomap.robot.doctor.diagnosis import Verdict, judge_base, judge_laser
from lemtomap.sim import worlds
from lemtomap.sim.base import BaseConfig, SimulatedBattery
from lemtomap.sim.errors import Unplugged
from lemtomap.sim.faults import Faults, LinkFaults
from lemtomap.sim.gyro import GyroConfig
from lemtomap.sim.simulator import SimConfig, Simulator


def told_by(config=None, faults=None, seconds=4.0, *, swapped=False):
    simulator = Simulator(worlds.load("office"), seed=1, config=config, faults=faults)
    cables = (simulator.hokuyo, simulator.kobuki) if swapped else (simulator.kobuki, simulator.hokuyo)
    base = Wire(KOBUKI, cables[0], KobukiSession(), lambda _: None, Unplugged)
    laser = Wire(HOKUYO, cables[1], HokuyoSession(), lambda _: None, Unplugged)
    from_base, from_laser = [], []
    for step in range(1, round(50 * seconds)):
        simulator.advance(0.02 * step)
        from_base += base.poll(0.02 * step)
        from_laser += laser.poll(0.02 * step)
    simulator.close()
    return from_base, from_laser


def bad(findings):
    return [str(finding) for finding in findings if finding.verdict is not Verdict.GOOD]


@pytest.fixture(scope="module")
def healthy():
    return told_by()


def test_a_healthy_robot_is_called_healthy(healthy):
    base, laser = healthy
    assert bad(judge_base(base)) == []
    assert bad(judge_laser(laser)) == []
    assert any("firmware 1.2.0" in str(finding) for finding in judge_base(base))
    assert any("URG-04LX-UG01" in str(finding) for finding in judge_laser(laser))


def test_a_tired_battery_and_a_drifting_gyro_are_named():
    config = SimConfig(
        base=BaseConfig(battery=SimulatedBattery(start_share=0.1), gyro=GyroConfig(bias_sigma_dps=0.5))
    )
    base, _ = told_by(config)
    said = bad(judge_base(base))
    assert any("battery 13.5 V" in line and "charge it" in line for line in said)
    assert any("gyro drifts" in line and "switch the base off" in line for line in said)


def test_a_bad_cable_is_named_on_both_devices():
    noisy = LinkFaults(lose_byte=2e-3, burst_s=0.016)
    base, laser = told_by(faults=Faults(kobuki=noisy, hokuyo=noisy), seconds=6.0)
    assert any("damaged packets" in line and "shorter cable" in line for line in bad(judge_base(base)))
    assert any("damaged replies" in line and "cable" in line for line in bad(judge_laser(laser)))
    assert any("late" in line and "latency timer" in line for line in bad(judge_base(base)))


def test_swapped_ports_are_named_by_what_answers():
    base, laser = told_by(swapped=True)
    assert any("laser" in line and "swapped" in line for line in bad(judge_base(base)))
    assert any("Kobuki" in line and "swapped" in line for line in bad(judge_laser(laser)))


def test_a_stranger_is_named_and_no_swapped_ports_are_suspected():
    stranger = WrongDeviceSeen(
        "not a laser but a device that speaks NMEA (a GPS receiver?) answers, it sent '$GP'"
    )
    said = " ".join(bad(judge_laser([stranger])))
    assert "speaks NMEA" in said
    assert "is it the right port?" in said
    assert "swapped" not in said


def test_old_firmware_is_named(healthy):
    base = [
        replace(
            event, firmware=Version(0, 9, 0), compatibility=Compatibility.INCOMPATIBLE, advice="update it"
        )
        if isinstance(event, BaseInfo)
        else event
        for event in healthy[0]
    ]
    assert bad(judge_base(base)) == ["FAULT Kobuki base: update it"]


def test_a_pressed_bumper_and_silence_are_named(healthy):
    pressed = [
        replace(event, bumper=Bumper.CENTER) if isinstance(event, KobukiSample) else event
        for event in healthy[0]
    ]
    assert any("bumper is pressed" in line for line in bad(judge_base(pressed)))
    assert bad(judge_base([])) == [
        "FAULT Kobuki base: sends no packets -> switch it on; is it the right cable?"
    ]
    assert "sends no scans" in bad(judge_laser([]))[0]


def test_a_dirty_window_a_cover_and_a_fault_are_named(healthy):
    def scans(change):
        made = []
        for event in healthy[1]:
            if isinstance(event, LaserScan):
                ranges = event.ranges_m.copy()
                change(ranges)
                made.append(replace(event, ranges_m=ranges))
        return made

    def dirt(ranges):
        ranges[300:310] = 0.03

    def cover(ranges):
        ranges[:] = np.nan

    assert any(
        "10 beams end at the window" in line and "wipe" in line for line in bad(judge_laser(scans(dirt)))
    )
    assert any("100 % of the beams" in line and "covered" in line for line in bad(judge_laser(scans(cover))))
    fault = [*healthy[1], LaserFault(1.0, "the laser diode is broken", "03")]
    assert bad(judge_laser(fault)) == ["FAULT Hokuyo laser: the laser diode is broken"]


def test_a_slow_latency_timer_is_named_with_the_command(tmp_path):
    timer = tmp_path / "class/tty/ttyUSB7/device/latency_timer"
    timer.parent.mkdir(parents=True)
    timer.write_text("16\n")
    said = bad(doctor.check_port(ports.KOBUKI, "Kobuki base", "/dev/ttyUSB7", tmp_path))
    assert len(said) == 1
    assert "latency timer is 16 ms" in said[0]
    assert f"sudo tee {timer}" in said[0]


def test_missing_devices_and_ports_are_findings_not_crashes():
    said = bad(doctor.examine(listen_s=0.1, list_all=list))
    assert any("no Kobuki base found" in line for line in said)
    assert any("no Hokuyo laser found" in line for line in said)
    said = bad(doctor.examine("/dev/nothing1", "/dev/nothing2", 0.1))
    assert any("/dev/nothing1: no such port" in line for line in said)


def test_the_program_that_holds_a_port_is_named():
    master, slave = os.openpty()
    try:
        holders = doctor.holders_of(os.ttyname(slave))
        assert any(f"process {os.getpid()}" in holder for holder in holders)
    finally:
        os.close(master)
        os.close(slave)
