import numpy as np
import pytest

from lemtomap.drivers.clock import ClockConfig, DeviceClock
from lemtomap.drivers.hokuyo.timesync import TimeSync


def arrivals(true_s, *, latency_s=0.008, burst_s=0.0, jitter_s=0.0, seed=0):
    """When packets sent at `true_s` arrive: in order, held back to the next burst."""
    rng = np.random.default_rng(seed)
    out = true_s + latency_s + jitter_s * rng.exponential(size=len(true_s))
    if burst_s:
        out = np.ceil(out / burst_s) * burst_s
    return np.maximum.accumulate(out)


def run(clock, *, bits, count, period_s, drift, boot_ms=65000, start_s=1e5, **wire):
    """Return the error of each mapped stamp against the true time at which the device made it."""
    true_s = start_s + np.arange(count) * period_s
    ticks = (boot_ms + np.arange(count) * period_s * 1000 / (1 + drift)).astype(int)
    stamps = [
        clock.map(int(tick) % 2**bits, float(at))
        for tick, at in zip(ticks, arrivals(true_s, **wire), strict=True)
    ]
    assert None not in stamps
    assert np.all(np.diff(stamps) > 0)
    return np.array(stamps) - true_s


@pytest.mark.parametrize("drift", [-80e-6, 0.0, 120e-6])
def test_bursts_of_16_ms_drift_and_wraps_do_not_reach_the_stamps(drift):
    clock = DeviceClock(ClockConfig(bits=16, latency_s=0.008))
    error = run(clock, bits=16, count=20000, period_s=0.02, drift=drift, burst_s=0.016, jitter_s=0.0005)
    assert np.abs(error[50:]).max() < 0.006
    assert np.abs(error[5000:]).max() < 0.0045  # 16 and 20 ms share a grid of 4 ms
    assert np.std(error[5000:]) < 0.0015  # raw arrivals scatter by 4.6 ms
    assert clock.drift == pytest.approx(drift, abs=10e-6)


def test_laser_stamps_wrap_after_four_hours_unnoticed():
    clock = DeviceClock(ClockConfig(bits=24, latency_s=0.1))
    error = run(
        clock,
        bits=24,
        count=3000,
        period_s=0.1,
        drift=50e-6,
        boot_ms=2**24 - 60_000,
        latency_s=0.1,
        jitter_s=0.002,
    )
    assert np.abs(error[100:]).max() < 0.005


def test_a_backlog_at_the_start_does_not_shift_the_clock():
    clock = DeviceClock(ClockConfig(bits=16))
    backlog = list(range(5000, 6000, 20))
    clock.begin(backlog[0], backlog[-1], 10.0)
    stamps = [clock.map(raw, 10.0) for raw in backlog]
    assert stamps == pytest.approx(np.arange(-49, 1) * 0.02 + 10.0)


def test_packets_that_waited_while_the_host_slept_keep_their_own_time():
    clock = DeviceClock(ClockConfig(bits=16))
    for i in range(100):
        clock.map(20 * i, 0.02 * i)
    late = [clock.map(20 * i, 7.0) for i in range(100, 150)]
    assert late == pytest.approx(0.02 * np.arange(100, 150))
    assert clock.resets == 0


def test_a_single_absurd_stamp_is_refused_and_a_restarted_device_is_followed():
    clock = DeviceClock(ClockConfig(bits=24))
    for i in range(100):
        clock.map(1_000_000 + 100 * i, 0.1 * i)
    assert clock.map(1_000_000 + 100 * 100 + 4096, 10.0) is None  # 4 s ahead of its time
    assert clock.map(1_000_000 + 100 * 99, 10.0) is None  # the same once more
    assert clock.map(1_000_000 + 100 * 101, 10.1) == pytest.approx(10.1)
    after_reset = [clock.map(100 * i, 10.2 + 0.1 * i) for i in range(6)]
    assert after_reset[:2] == [None, None]
    assert after_reset[3:] == pytest.approx([10.5, 10.6, 10.7])
    assert clock.resets == 1


@pytest.mark.parametrize("anchored", [False, True])
def test_a_device_clock_that_stood_still_is_followed_within_three_seconds(anchored):
    clock = DeviceClock(ClockConfig(bits=16))
    if anchored:
        clock.anchor(980, 99.0, 99.98)
    errors = []
    for i in range(1000):
        true_s = 100.0 + 0.02 * i + (0.4 if i >= 500 else 0.0)
        errors.append(clock.map(1000 + 20 * i, true_s + 0.001 * (i % 7)) - true_s)
    assert np.abs(errors[200:500]).max() < 0.03
    assert np.abs(errors[501:550]) == pytest.approx(np.full(49, 0.4), abs=0.03)  # not yet believed
    assert np.abs(errors[660:]).max() < 0.03


def test_two_way_exchange_takes_the_stream_latency_off():
    clock = DeviceClock(ClockConfig(bits=24, latency_s=0.1))
    sync = TimeSync()
    for i in range(9):  # device time = host time - 500 s; 1 ms there, 3 ms back; truncated to ms
        sent = 1000.0 + 0.0057 * i
        sync.add(int((sent + 0.001 - 500.0) * 1000), sent, sent + 0.004)
    assert sync.offset_s == pytest.approx(500.0, abs=sync.uncertainty_s)
    assert sync.uncertainty_s < 0.0021
    clock.anchor(sync.first_raw, sync.offset_s, 1000.1)
    rng = np.random.default_rng(3)
    for i in range(300):
        true_s = 1001.0 + 0.1 * i
        arrival_s = true_s + 0.112 + 0.004 * rng.random()
        stamp_s = clock.map(int((true_s - 500.0) * 1000 + 1e-6), arrival_s)
        assert stamp_s == pytest.approx(true_s, abs=0.004)


def test_late_host_in_one_exchange_leaves_the_offset_to_the_others():
    sync = TimeSync()
    sync.add(500_000, 1000.0, 1000.002)
    sync.add(500_010, 1000.010, 1000.300)
    sync.add(500_020, 1000.020, 1000.022)
    assert sync.offset_s == pytest.approx(500.0, abs=0.002)
