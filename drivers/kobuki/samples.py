"""Feedback in the robot's own units → samples in SI units and the events between two frames."""

import math
from collections.abc import Iterator
from typing import Final, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from lemtomap.drivers.kobuki.battery import Battery
from lemtomap.drivers.kobuki.events import (
    BumperEvent,
    ButtonEvent,
    CliffEvent,
    InputEvent,
    KobukiSample,
    OverCurrentEvent,
    WheelDropEvent,
)
from lemtomap.drivers.kobuki.packets import (
    RAW_GYRO_DPS_PER_DIGIT,
    Bumper,
    Button,
    Charge,
    Cliff,
    CliffAdc,
    DockingIr,
    Feedback,
    MotorCurrent,
    OverCurrent,
    RawGyro,
    WheelDrop,
)

EdgeEvent: TypeAlias = BumperEvent | CliffEvent | WheelDropEvent | ButtonEvent | OverCurrentEvent | InputEvent

_RAD_PER_CDEG: Final = math.pi / 18000.0
_RADPS_PER_DIGIT: Final = math.radians(RAW_GYRO_DPS_PER_DIGIT)
_DARK: Final = DockingIr(0, 0, 0)
_NO_ADC: Final = CliffAdc(0, 0, 0)
_NO_CURRENT: Final = MotorCurrent(0, 0)
_NO_GYRO: Final = RawGyro(0, ())
_F = TypeVar("_F", Bumper, Cliff, WheelDrop, Button, OverCurrent)


def sample_of(frame: Feedback, stamp_s: float, arrival_s: float, battery: Battery) -> KobukiSample:
    """Return the sample of one frame."""
    basic, inertial = frame.basic, frame.inertial
    adc = frame.cliff_adc or _NO_ADC
    current = frame.current or _NO_CURRENT
    gyro = frame.raw_gyro or _NO_GYRO
    return KobukiSample(
        stamp_s=stamp_s,
        arrival_s=arrival_s,
        device_ms=basic.timestamp_ms,
        left_ticks=basic.left_ticks,
        right_ticks=basic.right_ticks,
        left_pwm=basic.left_pwm,
        right_pwm=basic.right_pwm,
        gyro_yaw_rad=inertial.angle_cdeg * _RAD_PER_CDEG if inertial else math.nan,
        gyro_rate_radps=inertial.rate_cdegps * _RAD_PER_CDEG if inertial else math.nan,
        bumper=Bumper(basic.bumper),
        wheel_drop=WheelDrop(basic.wheel_drop),
        cliff=Cliff(basic.cliff),
        buttons=Button(basic.buttons),
        over_current=OverCurrent(basic.over_current),
        cliff_adc=(adc.right, adc.center, adc.left),
        battery=battery,
        left_current_a=0.01 * current.left_ca,
        right_current_a=0.01 * current.right_ca,
        docking_ir=frame.docking_ir or _DARK,
        raw_gyro_radps=raw_gyro_in_base_axes(gyro),
        raw_gyro_id=gyro.frame_id,
        inputs=frame.inputs,
        on_dock=basic.charger in {Charge.CHARGED, Charge.CHARGING},
    )


def raw_gyro_in_base_axes(gyro: RawGyro) -> NDArray[np.float64]:
    """Return float64 (N, 3), rad/s about x, y, z of the base: the chip is turned by 90 degrees about z."""
    rates = [(-y * _RADPS_PER_DIGIT, x * _RADPS_PER_DIGIT, z * _RADPS_PER_DIGIT) for x, y, z in gyro.samples]
    return np.array(rates, dtype=np.float64).reshape(-1, 3)


def edges(before: Feedback | None, frame: Feedback, stamp_s: float) -> Iterator[EdgeEvent]:
    """Yield one event for each contact, button, motor flag and input that changed; all that is set at
    first.
    """
    a, b = before.basic if before else None, frame.basic
    was = (a.bumper, a.cliff, a.wheel_drop, a.buttons, a.over_current) if a else (0, 0, 0, 0, 0)
    now = (b.bumper, b.cliff, b.wheel_drop, b.buttons, b.over_current)
    if was != now:
        for segment, pressed in _changed(Bumper, was[0], now[0]):
            yield BumperEvent(stamp_s, segment, pressed)
        for sensor, seen in _changed(Cliff, was[1], now[1]):
            yield CliffEvent(stamp_s, sensor, seen, _adc_of(sensor, frame.cliff_adc or _NO_ADC))
        for wheel, dropped in _changed(WheelDrop, was[2], now[2]):
            yield WheelDropEvent(stamp_s, wheel, dropped)
        for button, pressed in _changed(Button, was[3], now[3]):
            yield ButtonEvent(stamp_s, button, pressed)
        for motor, above in _changed(OverCurrent, was[4], now[4]):
            yield OverCurrentEvent(stamp_s, motor, above)
    if (
        before is not None
        and before.inputs
        and frame.inputs
        and before.inputs.digital != frame.inputs.digital
    ):
        yield InputEvent(stamp_s, frame.inputs.digital, before.inputs.digital ^ frame.inputs.digital)


def _changed(flags: type[_F], was: int, now: int) -> Iterator[tuple[_F, bool]]:
    for flag in flags:
        if (was ^ now) & flag:
            yield flag, bool(now & flag)


def _adc_of(sensor: Cliff, adc: CliffAdc) -> int:
    return {Cliff.RIGHT: adc.right, Cliff.CENTER: adc.center, Cliff.LEFT: adc.left}[sensor]
