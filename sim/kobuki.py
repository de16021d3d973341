"""Kobuki's firmware as seen through its serial port (kobuki-protocol, sections 2-4, 12 and 17).

Bytes in, wheel targets out; sensor readings in, 50 Hz feedback packets out. Little-endian throughout.
"""

import struct
from dataclasses import dataclass, field

HALF_BASE_MM = 115
MAX_WHEEL_MMPS = 700  # advertised limit of the faster wheel
HEADER = b"\xaa\x55"
HARDWARE = (1, 0, 4)
FIRMWARE = (1, 2, 0)
UDID = (97713968, 842422349, 1361404194)  # a real robot's (section 3.9)
FACTORY_GAINS = (100_000, 100, 2_000)
FIXED_SIZES = {1: 4, 3: 3, 4: 1, 9: 2, 12: 2, 13: 13, 14: 1}
"""Command id -> data bytes."""


@dataclass(frozen=True, slots=True)
class FakeKobukiConfig:
    """What differs between one firmware and another."""

    command_timeout_s: float = 0.6
    """Wheels stop this long after the last base command. No public figure exists; 0 means never."""
    power_on_ms: int = 4_000
    """First time stamp sent."""
    clock_ppm: float = 40.0
    """How much the device's clock runs fast (a crystal: tens of ppm)."""


@dataclass(frozen=True, slots=True)
class BaseReadings:
    """Everything one feedback packet tells, in the protocol's own units."""

    timestamp_ms: int
    left_ticks: int
    right_ticks: int
    angle_cdeg: int
    rate_cdegps: int
    bumper: int = 0
    wheel_drop: int = 0
    cliff: int = 0
    left_pwm: int = 0
    right_pwm: int = 0
    buttons: int = 0
    charger: int = 0
    battery_dv: int = 165
    over_current: int = 0
    dock_ir: tuple[int, int, int] = (0, 0, 0)
    """Right, centre, left receiver."""
    cliff_adc: tuple[int, int, int] = (1800, 1800, 1800)
    """Right, centre, left."""
    current_10ma: tuple[int, int] = (0, 0)
    """Left, right."""
    gyro_frame: int = 0
    gyro: tuple[tuple[int, int, int], ...] = ()
    """Raw samples x, y, z since the last packet (two or three)."""


@dataclass
class KobukiFirmware:
    """The state a host can change, and the answers it has asked for."""

    config: FakeKobukiConfig = field(default_factory=FakeKobukiConfig)
    outputs: int = 0x00F0
    """General purpose output register: LEDs and power."""
    gains: tuple[int, int, int] = FACTORY_GAINS
    gain_type: int = 0
    sounds: list[tuple[float, int]] = field(default_factory=list)
    """(time, sequence or -note) of the last sounds asked for."""
    bad_bytes: int = 0
    """Command bytes thrown away."""
    _buffer: bytearray = field(default_factory=bytearray)
    _target_mmps: tuple[int, int] = (0, 0)
    _commanded_s: float = float("-inf")
    _wanted: int = 0
    _gain_wanted: bool = False

    def receive(self, data: bytes, now_s: float) -> None:
        """Take command bytes; damaged or unknown ones are skipped."""
        self._buffer += data
        while (frame := self._next_frame()) is not None:
            self._execute(frame, now_s)

    def wheel_targets_mps(self, now_s: float) -> tuple[float, float]:
        """Return (left, right) wheel speeds asked for; zero after silence."""
        timeout = self.config.command_timeout_s
        if timeout and now_s - self._commanded_s > timeout:
            return 0.0, 0.0
        left, right = self._target_mmps
        return left / 1000.0, right / 1000.0

    def _next_frame(self) -> bytes | None:
        """Cut the next payload with a good checksum out of the buffer, rescanning rejected bytes."""
        buffer = self._buffer
        while True:
            start = buffer.find(HEADER)
            if start < 0:
                keep = 1 if buffer[-1:] == HEADER[:1] else 0
                self.bad_bytes += len(buffer) - keep
                del buffer[: len(buffer) - keep]
                return None
            self.bad_bytes += start
            del buffer[:start]
            if len(buffer) < 3 or len(buffer) < buffer[2] + 4:
                return None
            end = buffer[2] + 4
            if _xor(buffer[2:end]) == 0:
                payload = bytes(buffer[3 : end - 1])
                del buffer[:end]
                return payload
            self.bad_bytes += 1
            del buffer[:1]

    def _execute(self, payload: bytes, now_s: float) -> None:
        position = 0
        while position + 2 <= len(payload):
            command, size = payload[position], payload[position + 1]
            data = payload[position + 2 : position + 2 + size]
            position += 2 + size
            if len(data) == size and FIXED_SIZES.get(command) == size:
                self._command(command, data, now_s)

    def _command(self, command: int, data: bytes, now_s: float) -> None:
        if command == 1:
            speed, radius = struct.unpack("<hh", data)
            self._target_mmps = wheel_speeds_mmps(speed, radius)
            self._commanded_s = now_s
        elif command in {3, 4}:
            self.sounds.append((now_s, data[0] if command == 4 else -int.from_bytes(data[:2], "little")))
            del self.sounds[:-16]
        elif command == 9:
            self._wanted |= int.from_bytes(data, "little")  # asked twice is answered once
        elif command == 12:
            self.outputs = int.from_bytes(data, "little")
        elif command == 13:
            self.gain_type = data[0]
            self.gains = struct.unpack("<III", data[1:]) if data[0] else FACTORY_GAINS
        else:
            self._gain_wanted = True

    def packet(self, readings: BaseReadings) -> bytes:
        """Return one feedback packet with the answers asked for since the last one."""
        payload = _basic(readings)
        payload += bytes((3, 3, *readings.dock_ir))
        payload += struct.pack(
            "<BBhh3s", 4, 7, readings.angle_cdeg, _saturate(readings.rate_cdegps), b"\x88\x88\x88"
        )
        payload += struct.pack("<BB3H", 5, 6, *readings.cliff_adc)
        payload += bytes((6, 2, *readings.current_10ma))
        payload += _gyro(readings)
        payload += struct.pack("<BBH4H3H", 16, 16, 0x000F, 4095, 4095, 4095, 4095, 0, 0, 0)
        payload += self._answers()
        body = bytes((len(payload),)) + payload
        return HEADER + body + bytes((_xor(body),))

    def _answers(self) -> bytes:
        answers = b""
        if self._wanted & 0x01:
            answers += bytes((10, 4, *reversed(HARDWARE), 0))
        if self._wanted & 0x02:
            answers += bytes((11, 4, *reversed(FIRMWARE), 0))
        if self._wanted & 0x08:
            answers += struct.pack("<BB3I", 19, 12, *UDID)
        if self._gain_wanted:
            answers += struct.pack("<BBB3I", 21, 13, self.gain_type, *self.gains)
        self._wanted, self._gain_wanted = 0, False
        return answers


def wheel_speeds_mmps(speed: int, radius: int) -> tuple[int, int]:
    """Return (left, right) of a base command, integer arithmetic as in the firmware (section 4.1).

    The faster wheel is held to MAX_WHEEL_MMPS and the other one adapted, so that the radius stays.
    """
    if radius == 0:
        left, right = speed, speed
    elif abs(radius) == 1:
        left, right = -radius * speed, radius * speed
    else:
        r = abs(radius)
        inner = int(speed * (r - HALF_BASE_MM) / (r + HALF_BASE_MM))
        left, right = (inner, speed) if radius > 0 else (speed, inner)
    fastest = max(abs(left), abs(right))
    if fastest > MAX_WHEEL_MMPS:
        left, right = int(left * MAX_WHEEL_MMPS / fastest), int(right * MAX_WHEEL_MMPS / fastest)
    return left, right


def _basic(readings: BaseReadings) -> bytes:
    return struct.pack(
        "<BBHBBBHHbbBBBB",
        1,
        15,
        readings.timestamp_ms & 0xFFFF,
        readings.bumper,
        readings.wheel_drop,
        readings.cliff,
        readings.left_ticks & 0xFFFF,
        readings.right_ticks & 0xFFFF,
        readings.left_pwm,
        readings.right_pwm,
        readings.buttons,
        readings.charger,
        readings.battery_dv,
        readings.over_current,
    )


def _gyro(readings: BaseReadings) -> bytes:
    words = [_saturate(value) for sample in readings.gyro for value in sample]
    head = bytes((13, 2 + 2 * len(words), readings.gyro_frame & 0xFF, len(words)))
    return head + struct.pack(f"<{len(words)}h", *words)


def _saturate(value: int) -> int:
    return max(-32768, min(32767, value))


def _xor(data: bytes | bytearray) -> int:
    result = 0
    for byte in data:
        result ^= byte
    return result
