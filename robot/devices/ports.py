"""Which serial port is which device: by USB identity, never by order."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from serial.tools import list_ports

from lemtomap.drivers.errors import PortMissing
from lemtomap.errors import BadSetting


class PortInfo(Protocol):
    """What pyserial tells of a port."""

    device: str
    vid: int | None
    pid: int | None
    manufacturer: str | None
    product: str | None
    serial_number: str | None


@dataclass(frozen=True, slots=True)
class UsbIdentity:
    """How one kind of device shows itself on USB."""

    name: str
    option: str
    vid: int
    pid: int
    words: tuple[str, ...]
    """One of these stands in manufacturer, product or serial number; empty: vid and pid are enough."""
    link: str
    """The stable name that our udev rules make."""


KOBUKI = UsbIdentity("Kobuki base", "kobuki", 0x0403, 0x6001, ("kobuki", "yujin"), "/dev/kobuki")
HOKUYO = UsbIdentity("Hokuyo laser", "hokuyo", 0x15D1, 0x0000, (), "/dev/hokuyo")

ListPorts = Callable[[], Iterable[PortInfo]]


def find(identity: UsbIdentity, ports: ListPorts = list_ports.comports) -> str:
    """Return the path of the one port with this identity.

    Raises PortMissing when there is none, BadSetting when there are several to choose from.
    """
    seen = list(ports())
    matches = sorted(port.device for port in seen if matches_identity(port, identity))
    if len(matches) == 1:
        return matches[0]
    if not matches:
        others = ", ".join(sorted(describe(port) for port in seen if port.vid is not None)) or "none at all"
        raise PortMissing(
            f"no {identity.name} found (USB {identity.vid:04x}:{identity.pid:04x}); serial ports: {others}"
        )
    link = Path(identity.link)
    if link.exists() and str(link.resolve()) in matches:
        return str(link.resolve())
    raise BadSetting(
        f"several ports look like a {identity.name}: {', '.join(matches)}; give --{identity.option}"
    )


def matches_identity(port: PortInfo, identity: UsbIdentity) -> bool:
    """Return True if a port has this identity; a bare FTDI chip (0403:6001) may be anything, not a Kobuki."""
    if (port.vid, port.pid) != (identity.vid, identity.pid):
        return False
    text = " ".join(part for part in (port.manufacturer, port.product, port.serial_number) if part).lower()
    return not identity.words or any(word in text for word in identity.words)


def describe(port: PortInfo) -> str:
    """Return a port as a person would name it."""
    what = port.product or port.manufacturer or "unnamed device"
    return f"{port.device} ({what}, {port.vid or 0:04x}:{port.pid or 0:04x})"
