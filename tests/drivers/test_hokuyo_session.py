import math

import numpy as np
import pytest
from device_side import II, PP, Urg, kobuki_feedback, scip_fields, scip_status

from lemtomap.drivers.hokuyo.events import (
    LaserDown,
    LaserFault,
    LaserScan,
    LaserUp,
    LaserWell,
    SensorInfo,
    WrongDeviceSeen,
    is_healthy,
)
from lemtomap.drivers.hokuyo.scans import View
from lemtomap.drivers.hokuyo.session import HokuyoConfig, HokuyoSession
from lemtomap.drivers.hokuyo.steps import HandshakeStep

STEP_S = 0.1 / 1024


def of(events, kind):
    return [event for event in events if isinstance(event, kind)]


class Bench:
    """A session and a fake sensor on one time line, 5 ms a turn."""

    def __init__(self, urg=None, session=None):
        self.urg = urg or Urg(boot_s=-1000.0)
        self.session = session or HokuyoSession()
        self.now_s = 0.0
        self.events = []
        self.ranges = [1000] * 682
        self.damage = lambda data: data
        self._pending = b""

    def run(self, seconds, until=lambda _: False):
        for _ in range(round(seconds / 0.005)):
            new = self.session.receive(self.damage(self._pending), self.now_s)
            self.events += new
            self._pending = self.urg.feed(self.session.tick(self.now_s), self.now_s)
            self.now_s += 0.005
            if round(self.now_s / 0.005) % 20 == 0:
                self._pending += self.urg.scan(self.now_s, self.ranges)
            if any(until(event) for event in new):
                break
        return self

    def first_scan(self, limit_s=3.0):
        return self.run(limit_s, until=lambda event: isinstance(event, LaserScan))


def half_a_command():
    urg = Urg()
    urg.feed(b"MD00440", 0.0)
    return urg


def left_streaming():
    urg = Urg(boot_s=-100.0)
    urg.streaming = b"MD0044072501000"
    return urg


STATES = {
    "fresh": Urg(),
    "streaming": left_streaming(),
    "half a command": half_a_command(),
    "SCIP 1.1": Urg(scip1=True),
    "time mode": Urg(time_mode=True),
    "no time mode": Urg(refuse_time=True),
    "VV unanswered": Urg(mute={b"VV"}),
    "II unanswered": Urg(mute={b"II"}),
    "RS unanswered": Urg(mute={b"RS"}),
}


@pytest.mark.parametrize("urg", STATES.values(), ids=STATES)
def test_connects_within_three_seconds_whatever_state_the_sensor_is_in(urg):
    bench = Bench(urg).first_scan()
    assert of(bench.events, LaserScan), bench.session.step
    assert urg.heard.count(b"VV") == 1
    assert not [line for line in urg.heard if line[:2] in {b"ME", b"GE", b"AR"}]
    assert of(bench.events, LaserUp)[0].clock_synchronised == (not urg.refuse_time)
    assert len(of(bench.events, SensorInfo)) == 1


def test_scan_has_its_first_beams_time_its_angles_and_its_codes_told_apart():
    bench = Bench()
    bench.ranges = [0, 6, 7, 19, 20, 5600, 5601, *[1234] * 675]
    scan = of(bench.first_scan().events, LaserScan)[0]
    assert np.isposinf(scan.ranges_m[0])
    assert np.isnan(scan.ranges_m[[1, 2, 3, 6]]).all()
    assert scan.ranges_m[[4, 5, 7]] == pytest.approx([0.02, 5.6, 1.234])
    assert (scan.angle_min_rad, scan.angle_step_rad) == (
        pytest.approx(-2.086214, abs=1e-6),
        2 * math.pi / 1024,
    )
    assert scan.angle_min_rad + 681 * scan.angle_step_rad == pytest.approx(2.092350, abs=1e-6)
    assert scan.time_step_s == pytest.approx(STEP_S)
    true_s = bench.now_s - 0.005 - 0.1 + 44 * STEP_S
    assert scan.stamp_s == pytest.approx(true_s, abs=0.006)
    assert (scan.range_min_m, scan.range_max_m, scan.complete, scan.missed) == (0.02, 5.6, True, 0)


def test_a_longer_sister_is_served_by_what_it_tells_of_itself():
    told = {"DMIN": 23, "DMAX": 60000, "ARES": 1440, "AMIN": 0, "AMAX": 1080, "AFRT": 540, "SCAN": 2400}
    utm = [
        ("MODL", "UTM-30LX(Hokuyo Automatic Co.,Ltd.)"),
        *((key, str(value)) for key, value in told.items()),
    ]
    bench = Bench(Urg(boot_s=-1000.0, parameters=utm))
    bench.ranges = [1, 3, 22, 23, 30000, *[5000] * 1076]
    scan = of(bench.first_scan().events, LaserScan)[0]
    assert bench.urg.heard[-1] == b"MD0000108001000"
    assert np.isposinf(scan.ranges_m[0])  # nothing seen is code 1 here
    assert np.isnan(scan.ranges_m[1:3]).all()
    assert scan.ranges_m[3:6] == pytest.approx([0.023, 30.0, 5.0])
    assert (scan.angle_min_rad, scan.range_max_m) == (pytest.approx(-0.75 * math.pi), 60.0)


def test_view_limits_angles_clusters_and_skips():
    view = View(angle_min_rad=-math.pi / 2, angle_max_rad=math.pi / 2, cluster=3, skip=1)
    bench = Bench(session=HokuyoSession(HokuyoConfig(view=view)))
    bench.ranges = [1000] * 171
    scan = of(bench.first_scan().events, LaserScan)[0]
    assert b"MD0128064003100" in bench.urg.heard
    assert scan.angle_min_rad == pytest.approx(
        math.radians(-90) + 2 * math.pi / 1024
    )  # middle of the first three
    assert (scan.angle_step_rad, scan.time_step_s) == (
        pytest.approx(6 * math.pi / 1024),
        pytest.approx(3 * STEP_S),
    )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: View(cluster=0), "cluster is 0"),
        (lambda: View(skip=10), "skip is 10"),
        (lambda: View(angle_min_rad=1.0, angle_max_rad=-1.0), "must lie below"),
    ],
)
def test_views_no_sensor_has_are_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_counted_runs_are_armed_again():
    bench = Bench(session=HokuyoSession(HokuyoConfig(view=View(count=3))))
    scan, left = bench.urg.scan, [3]

    def counted(now_s, ranges):
        if bench.urg.streaming is None:
            return b""
        left[0] = (left[0] or 3) - 1
        bench.urg.streaming = bench.urg.streaming[:13] + b"%02d" % left[0]
        data = scan(now_s, ranges)
        bench.urg.streaming = bench.urg.streaming if left[0] else None
        return data

    bench.urg.scan = counted
    bench.run(1.4)
    assert bench.urg.heard.count(b"MD0044072501003") >= 4
    assert bench.session.counters.scans >= 10
    assert bench.session.counters.missed == 0


def test_missed_scans_are_counted_and_damaged_ones_are_told_from_whole_ones():
    bench = Bench().first_scan()
    bench.run(0.5)
    bench.damage = lambda _: b""
    bench.run(0.25)
    bench.damage = lambda data: data[:500] + data[501:] if len(data) > 2000 else data
    bench.run(0.3)
    bench.damage = lambda data: data
    bench.events.clear()
    bench.run(0.5)
    partial, whole = (bench.session.counters.partial, of(bench.events, LaserScan))
    assert bench.session.counters.missed in {2, 3}
    assert partial == 3
    assert all(scan.complete and not scan.missed for scan in whole)


def test_silent_stream_is_started_anew_without_another_version_request():
    bench = Bench().first_scan()
    bench.urg.streaming = None  # as after a brown-out
    bench.run(1.5)
    assert [type(event) for event in bench.events if isinstance(event, LaserUp | LaserDown)] == [
        LaserUp, LaserDown, LaserUp,
    ]  # fmt: skip
    assert bench.urg.heard.count(b"VV") == 1
    assert bench.session.alive


def test_sensor_that_was_reset_under_us_gets_a_new_epoch():
    bench = Bench().first_scan()
    bench.run(1.0)
    bench.urg.epoch_s = bench.now_s - 0.3
    bench.events.clear()
    bench.run(1.0)
    for scan in of(bench.events, LaserScan):
        assert scan.arrival_s - scan.stamp_s == pytest.approx(0.1, abs=0.03)
    assert len(of(bench.events, LaserScan)) >= 7


def test_checking_is_waited_for_and_trouble_is_named_and_tried_again():
    bench = Bench().first_scan()
    bench.events.clear()
    scan, bench.urg.scan = bench.urg.scan, lambda *_: b""
    bench._pending += scip_status(b"MD0044072501000", b"35")
    bench.run(3.0)
    assert [event.code for event in of(bench.events, LaserFault)] == ["35"]
    assert not of(bench.events, LaserDown)
    bench._pending += scip_status(b"MD0044072501000", b"98")
    bench.urg.scan = scan
    bench.run(0.3)
    assert of(bench.events, LaserWell)
    bench._pending += scip_status(b"MD0044072501000", b"71")
    bench.run(2.5)
    fault = of(bench.events, LaserFault)[-1]
    assert (fault.code, "motor" in fault.reason, fault.recovering) == ("71", True, True)
    assert bench.session.alive
    assert bench.urg.heard.count(b"VV") == 1


def test_dead_sensor_is_reported_once_and_found_when_it_wakes_up():
    bench = Bench()
    feed, bench.urg.feed = bench.urg.feed, lambda *_: b""
    bench.run(12.0)
    (fault,) = of(bench.events, LaserFault)
    assert "does not answer: check the cable" in fault.reason
    bench.urg.feed = feed
    assert of(bench.first_scan(3.5).events, LaserScan)


def test_refused_view_is_named_with_the_sensors_code():
    bench = Bench()
    answer = bench.urg._answer
    bench.urg._answer = lambda line, now_s: (
        scip_status(line, b"04") if line[:2] == b"MD" else answer(line, now_s)
    )
    bench.run(2.0)
    fault = of(bench.events, LaserFault)[0]
    assert (fault.code, "MD0044072501000 is refused" in fault.reason) == ("04", True)


def refuse(bench, name, status, times):
    """Let the sensor refuse a command so often before it obeys."""
    answer, left = bench.urg._answer, [times]

    def stubborn(line, now_s):
        if line[: len(name)] == name and left[0] > 0:
            left[0] -= 1
            return scip_status(line, status)
        return answer(line, now_s)

    bench.urg._answer = stubborn


REFUSALS = [(b"PP", b"0E", 1), (b"PP", b"0B", 1), (b"II", b"0A", 9), (b"TM0", b"01", 9), (b"TM1", b"04", 9)]


@pytest.mark.parametrize(("name", "status", "times"), [*REFUSALS, (b"MD", b"0B", 1)])
def test_refusals_on_the_way_are_got_over(name, status, times):
    bench = Bench()
    refuse(bench, name, status, times)
    assert of(bench.first_scan(4.0).events, LaserScan)
    assert not of(bench.events, LaserFault)


def test_parameters_that_contradict_one_another_are_a_named_fault():
    wrong = [(key, "30" if key == "AMAX" else value) for key, value in PP]
    bench = Bench(Urg(parameters=wrong)).run(1.0)
    assert "the sensor's parameters contradict one another" in of(bench.events, LaserFault)[0].reason


def test_sensor_that_says_it_is_ill_is_reported_and_tried_all_the_same():
    bench = Bench()
    well, ill = scip_fields(b"II", II), scip_fields(b"II", [*II[:-1], ("STAT", "Laser unstable")])
    bench.damage = lambda data: data.replace(well, ill)
    bench.first_scan()
    assert of(bench.events, LaserFault)[0].reason == "the laser says of itself: Laser unstable"
    assert of(bench.events, LaserScan)


def test_noise_on_the_line_does_not_stop_it():
    rng = np.random.default_rng(5)

    def noisy(data):
        array = np.frombuffer(data, dtype=np.uint8).copy()
        array[rng.random(len(array)) < 1e-4] ^= 0x10
        return array[rng.random(len(array)) >= 1e-3].tobytes()

    bench = Bench()
    bench.damage = noisy
    bench.run(20.0)
    counters = bench.session.counters
    assert counters.scans >= 180
    assert counters.partial < counters.scans
    for scan in of(bench.events, LaserScan):
        assert set(np.unique(scan.ranges_m[~np.isnan(scan.ranges_m)])) <= {np.float32(1.0)}
        assert 0.09 < scan.arrival_s - scan.stamp_s < 0.13


def test_base_on_the_port_is_named_and_left_in_peace():
    session = HokuyoSession()
    events, sent = [], []
    for i in range(50):
        events += session.receive(kobuki_feedback(i), 0.02 * i)
        sent.append(session.tick(0.02 * i))
    (seen,) = of(events, WrongDeviceSeen)
    assert "not a laser but a Kobuki base answers, it sent aa 55" in seen.reason
    assert not any(sent[5:])


def listen(line, period_s=1.0, until_s=8.0):
    """Return what a laser session says of somebody who prints one line a period, and what it sent last."""
    session, told, sent = HokuyoSession(), [], []
    for i in range(round(50 * until_s)):
        now_s = 0.02 * i
        data = line if line and i % round(50 * period_s) == 30 else b""
        told += [(now_s, event) for event in session.receive(data, now_s)]
        sent.append(session.tick(now_s))
    return told, sent


@pytest.mark.parametrize(
    ("line", "name"),
    [
        (b"$GPGGA,092750.000,5321.6802,N,00630.3372,W,1,8,1.03,61.7,M,55.2,M,,*76\r\n", "NMEA"),
        (b"temperature 21.5\r\n", "plain text"),
    ],
    ids=str,
)
def test_a_slow_stranger_is_named_by_what_it_said_and_no_cable_blamed(line, name):
    told, sent = listen(line)
    ((when_s, seen),) = [each for each in told if isinstance(each[1], WrongDeviceSeen)]
    assert when_s < 4.0
    assert f"not a laser but a device that speaks {name}" in seen.reason
    assert repr(line[:5].decode())[:-1] in seen.reason
    assert not [event for _, event in told if isinstance(event, LaserFault)]
    assert not any(sent[-200:])


def test_a_stranger_whose_lines_might_end_a_scan_is_named_after_some():
    told, _ = listen(b"42\n")
    (seen,) = [event for _, event in told if isinstance(event, WrongDeviceSeen)]
    assert "a device that speaks plain text answers, it sent '42\\n42\\n42\\n" in seen.reason


@pytest.mark.parametrize(
    ("line", "period_s"),
    [(b"", 1.0), (b"\xff\x00", 1.0), (b"0Ab0Ab0Ab\n0A2\n", 100.0)],
    ids=["silence", "noise", "end of a scan"],
)
def test_without_a_stranger_a_laser_that_does_not_answer_is_a_matter_of_the_cable(line, period_s):
    told, _ = listen(line, period_s)
    assert not [event for _, event in told if isinstance(event, WrongDeviceSeen)]
    assert any("check the cable" in event.reason for _, event in told if isinstance(event, LaserFault))


def test_state_of_health_texts_of_the_field_are_known():
    for text in ("Sensor works well.", "sensor is working normally", "Stable 000 no error.", ""):
        assert is_healthy(text)
    assert not is_healthy("Laser abnormal")


def test_parameters_damaged_on_the_way_are_asked_for_again():
    bench = Bench()
    spoilt = iter([True])
    bench.damage = lambda data: (
        data.replace(b"DMAX:5600", b"DMAX:5601") if b"DMAX" in data and next(spoilt, False) else data
    )
    bench.first_scan()
    assert bench.urg.heard.count(b"PP") == 2
    assert of(bench.events, SensorInfo)[0].parameters.max_mm == 5600
    assert bench.session.step is HandshakeStep.STREAM
