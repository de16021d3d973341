"""A driver for your own laser: the LDS-01 of a TurtleBot 3 as a session, kept talking by LEMTOMap's driver.

A pseudo-terminal plays the laser. It prints three turns; in the second a damaged packet costs its six beams.
"""

import asyncio
import contextlib
import os
import time

import numpy as np

from lemtomap import Scan
from lemtomap.drivers.driver import Driver
from lemtomap.drivers.port import open_serial


class LdsSession:
    """60 packets a turn: 0xFA, 0xA0 + number, speed, 6 beams (strength, mm, unused), a check byte twice."""

    def reopened(self) -> None:
        self.alive, self._bytes, self._ranges_m = False, bytearray(), np.full(360, np.nan, np.float32)

    def receive(self, data: bytes, now_s: float) -> list[Scan]:
        self._bytes += data
        scans = []
        while len(self._bytes) >= 42:
            packet = bytes(self._bytes[:42])
            if packet[0] != 0xFA or set(packet[40:]) != {0xFF - sum(packet[:40]) % 256}:
                del self._bytes[0]  # no packet begins here, or a damaged one: look further on
                continue
            del self._bytes[:42]
            self.alive, first = True, 6 * (packet[1] - 0xA0)
            self._ranges_m[first : first + 6] = np.frombuffer(packet[4:40], "<u2")[1::3] / 1000.0
            if first == 354:  # the last packet of a turn
                scans.append(Scan(now_s, self._ranges_m.copy(), 0.0, np.pi / 180, range_max_m=3.5))
                self._ranges_m[:] = np.nan
        return scans

    def tick(self, now_s: float) -> bytes:  # noqa: ARG002 - the laser needs no time
        return b"" if self.alive else b"b"

    def close_bytes(self) -> bytes:
        return b"e"


def take(event: object) -> None:
    if isinstance(event, Scan):
        print(np.isfinite(event.ranges_m).sum(), "beams, wall at", np.nanmedian(event.ranges_m), "m")
    os.write(laser, turns.pop(0))


laser, host = os.openpty()
heads = [bytes([0xFA, 0xA0 + k, 0, 0]) + bytes([9, 0, 0xD0, 0x07, 0, 0]) * 6 for k in range(60)]
turn = b"".join(head + bytes([0xFF - sum(head) % 256]) * 2 for head in heads)
turns = [turn, turn[:99] + b"?" + turn[100:], turn]
driver = Driver(lambda: open_serial(os.ttyname(host), 230400), LdsSession(), time.monotonic, take)
with contextlib.suppress(IndexError):  # what `take` raises ends the driver
    asyncio.run(driver.run())
