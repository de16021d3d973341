"""A byte port, and the real serial one."""

from typing import Protocol


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
