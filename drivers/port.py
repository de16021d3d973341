"""A byte port, and the real serial one."""

import asyncio
import contextlib
import errno
import fcntl
import os
from typing import Final, Protocol

import serial
from serial_asyncio_fast import SerialTransport, create_serial_connection

from lemtomap.drivers.errors import (
    PortBroken,
    PortBusy,
    PortClosed,
    PortDenied,
    PortError,
    PortMissing,
)

KOBUKI_BAUD: Final = 115200  # protocol.rst
HOKUYO_BAUD: Final = 115200  # without effect over USB
_WAITING_LIMIT: Final = 512  # bytes; a base that takes no more would otherwise get stale velocities later
_CLOSE_TIMEOUT_S: Final = 0.5


class BytePort(Protocol):
    """Bytes to and from one device."""

    async def read(self) -> bytes:
        """Wait for bytes and return them (never empty). Raises PortBroken, PortClosed."""
        ...

    def write(self, data: bytes) -> None:
        """Send bytes without waiting; what does not fit is an error. Raises PortBroken, PortClosed."""
        ...

    async def aclose(self) -> None:
        """Close; a pending read raises PortClosed. Closing twice is fine."""
        ...


async def open_serial(path: str, baud: int = 115200) -> "SerialPort":
    """Open a serial port for this program alone, raw, 8N1, what came before thrown away.

    Raises PortMissing, PortDenied or PortBusy, each with the path and the cure.
    """
    loop = asyncio.get_running_loop()
    try:
        _, port = await create_serial_connection(
            loop, lambda: SerialPort(path), path, baudrate=baud, exclusive=True
        )
    except (OSError, ValueError) as error:
        raise _explain(path, error) from error
    assert isinstance(port, SerialPort)  # noqa: S101  # what the factory above made
    await port.made()
    return port


def _explain(path: str, error: Exception) -> PortError:
    number = getattr(error, "errno", None)
    if number in {errno.EACCES, errno.EPERM}:
        cure = "add yourself to the group dialout (sudo usermod -aG dialout $USER, then log in again)"
        return PortDenied(f"{path}: no permission; {cure}")
    if number in {errno.EAGAIN, errno.EBUSY}:
        return PortBusy(f"{path}: another program has this port; stop it first")
    if number == errno.ENOENT:
        return PortMissing(f"{path}: no such port; is the cable in, and the device switched on?")
    if number in {errno.ENXIO, errno.ENODEV, errno.EIO}:
        return PortMissing(f"{path}: no device behind this port; unplug it and plug it in again")
    return PortMissing(f"{path}: not a serial port ({error})")


class SerialPort(asyncio.Protocol):
    """One open serial port. Made by `open_serial`."""

    def __init__(self, path: str) -> None:
        self.path = path
        self._transport: SerialTransport | None = None
        self._received = bytearray()
        self._waiting = bytearray()
        self._sent = asyncio.Event()
        self._news = asyncio.Event()
        self._made = asyncio.Event()
        self._lost = asyncio.Event()
        self._failure: PortError | None = None

    async def made(self) -> None:
        """Wait until the transport is there, then claim the port. Raises PortBusy."""
        await self._made.wait()
        device = self._device()
        with contextlib.suppress(ValueError, OSError, NotImplementedError):
            device.set_low_latency_mode(
                low_latency_settings=True
            )  # FTDI: 1 ms instead of 16 ms; no root needed
        try:
            # pyserial took a BSD lock; the official Kobuki driver looks for a POSIX one
            fcntl.lockf(device.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            await self.aclose()
            raise _explain(self.path, error) from error

    async def read(self) -> bytes:
        """Wait for bytes and return them (never empty). Raises PortBroken, PortClosed."""
        while not self._received:
            if self._failure is not None:
                raise self._failure
            self._news.clear()
            await self._news.wait()
        data = bytes(self._received)
        self._received.clear()
        return data

    def write(self, data: bytes) -> None:
        """Send bytes without waiting. Raises PortBroken (also when the device takes no more), PortClosed.

        Goes past pyserial, whose write spins for ever on a device that takes nothing.
        """
        if self._failure is not None:
            raise self._failure
        self._waiting += data
        if len(self._waiting) == len(data):
            self._push()
        if len(self._waiting) > _WAITING_LIMIT:
            self._break(f"the device takes no more bytes ({len(self._waiting)} wait)")
        if self._failure is not None:
            raise self._failure

    async def aclose(self) -> None:
        """Send what waits, for at most half a second, and close. Closing twice is fine."""
        if self._failure is None:
            self._failure = PortClosed(f"{self.path}: closed")
        self._news.set()
        if self._transport is None:
            return
        if self._waiting:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._sent.wait(), _CLOSE_TIMEOUT_S)
        self._hang_up()
        with contextlib.suppress(TimeoutError):  # the kernel may hold a stalled device longer than we care
            await asyncio.wait_for(self._lost.wait(), _CLOSE_TIMEOUT_S)

    def _push(self) -> None:
        """Hand the kernel what it takes; come back when it takes more."""
        loop, number = asyncio.get_running_loop(), self._device().fileno()
        try:
            sent = os.write(number, self._waiting)
        except BlockingIOError:
            sent = 0
        except OSError as error:
            self._break(str(error))
            return
        del self._waiting[:sent]
        if self._waiting:
            self._sent.clear()
            loop.add_writer(number, self._push)
        else:
            self._sent.set()
            loop.remove_writer(number)

    def _hang_up(self) -> None:
        transport = self._transport
        if transport is not None and not transport.is_closing():
            asyncio.get_running_loop().remove_writer(self._device().fileno())
            transport.abort()  # closes without pyserial's drain; the kernel still sends what it has

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Asyncio's word that the port is open."""
        assert isinstance(transport, SerialTransport)  # noqa: S101  # made by create_serial_connection
        self._transport = transport
        self._made.set()

    def data_received(self, data: bytes) -> None:
        """Asyncio's bytes."""
        self._received += data
        self._news.set()

    def connection_lost(self, exc: Exception | None) -> None:
        """Asyncio's word that the port is closed, by us or by a pulled plug."""
        if self._failure is None:
            self._failure = PortBroken(f"{self.path}: unplugged ({exc})")
        self._transport = None
        self._news.set()
        self._lost.set()

    def _break(self, reason: str) -> None:
        if self._failure is None:
            self._failure = PortBroken(f"{self.path}: {reason}")
        self._news.set()
        self._hang_up()

    def _device(self) -> serial.Serial:
        device = self._transport.serial if self._transport is not None else None
        if device is None:
            raise PortClosed(f"{self.path}: closed")
        return device
