"""Sounds, LEDs, digital outputs and power rails: commands as bytes, and the memory the output register
lacks.
"""

from collections.abc import Iterable

from lemtomap.drivers.kobuki.codec import encode
from lemtomap.drivers.kobuki.commands import (
    ALL_POWER,
    GeneralOutput,
    Led,
    Output,
    Sound,
    SoundSequence,
    Tune,
)

_LED_SHIFT = {1: 8, 2: 10}
_DIGITAL = (Output.DO0, Output.DO1, Output.DO2, Output.DO3)


class Panel:
    """Everything on the base that is not a wheel. Each method returns the bytes to send."""

    def __init__(self) -> None:
        self.bits = ALL_POWER  # what the official driver assumes of a base just switched on

    def sound(self, tune: Tune) -> bytes:
        """Play a tune of the firmware."""
        return encode(SoundSequence(tune))

    def melody(self, tones: Iterable[tuple[float, float]]) -> list[bytes]:
        """Return one command for each (frequency in Hz, duration in s, at most 0.255); send each when the
        last ended.
        """
        return [encode(Sound.from_frequency(frequency_hz, duration_s)) for frequency_hz, duration_s in tones]

    def led(self, number: int, colour: Led) -> bytes:
        """Set LED 1 or 2, leave all other outputs. Raises ValueError for other numbers."""
        if number not in _LED_SHIFT:
            raise ValueError(f"the Kobuki has LED 1 and LED 2, not {number}")
        shift = _LED_SHIFT[number]
        return self.outputs((self.bits & ~Output(0x3 << shift)) | Output(colour << shift))

    def digital_output(self, number: int, *, on: bool) -> bytes:
        """Set open-drain output 0 to 3, leave all others. Raises ValueError for other numbers."""
        if number not in range(len(_DIGITAL)):
            raise ValueError(f"the Kobuki has digital outputs 0 to 3, not {number}")
        return self._switch(_DIGITAL[number], on=on)

    def external_power(self, rail: Output, *, on: bool) -> bytes:
        """Switch power rails, leave all other outputs. Raises ValueError for what is no rail."""
        if rail & ~ALL_POWER:
            raise ValueError(f"{rail!r} is no power rail")
        return self._switch(rail, on=on)

    def outputs(self, bits: Output) -> bytes:
        """Set the whole output register."""
        self.bits = bits
        return encode(GeneralOutput(bits))

    def _switch(self, bits: Output, *, on: bool) -> bytes:
        return self.outputs(self.bits | bits if on else self.bits & ~bits)
