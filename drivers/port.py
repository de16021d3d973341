"""A byte port, and the real serial one."""

import asyncio
import contextlib
import errno
import fcntl
from typing import Final, Protocol

import serial
from serial_asyncio_fast import SerialTransport, create_serial_connection

from drivers.errors import PortBroken, PortBusy, PortClosed, PortDenied, PortError, PortMissing

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
        """Send bytes without waiting. Raises PortBroken (also when the device takes no more), PortClosed."""
        if self._failure is not None:
            raise self._failure
        transport = self._transport
        if transport is None or transport.is_closing():
            raise PortClosed(f"{self.path}: closed")
        waiting = transport.get_write_buffer_size()
        if waiting + len(data) > _WAITING_LIMIT:
            self._break(f"the device takes no more bytes ({waiting} wait)")
            raise PortBroken(f"{self.path}: the device takes no more bytes")
        try:
            sent = 0 if waiting else self._device().write(data) or 0
        except BlockingIOError:
            sent = 0
        except OSError as error:
            self._break(str(error))
            raise PortBroken(f"{self.path}: {error}") from error
        if sent < len(data):
            transport.write(data[sent:])

    async def aclose(self) -> None:
        """Send what waits, for at most half a second, and close. Closing twice is fine."""
        if self._failure is None:
            self._failure = PortClosed(f"{self.path}: closed")
        self._news.set()
        if self._transport is None:
            return
        self._transport.close()
        try:
            await asyncio.wait_for(self._lost.wait(), _CLOSE_TIMEOUT_S)
        except TimeoutError:
            self._transport.abort()
            await self._lost.wait()

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
        self._failure = PortBroken(f"{self.path}: {reason}")
        self._news.set()
        if self._transport is not None:
            self._transport.abort()

    def _device(self) -> serial.Serial:
        device = self._transport.serial if self._transport is not None else None
        if device is None:
            raise PortClosed(f"{self.path}: closed")
        return device
