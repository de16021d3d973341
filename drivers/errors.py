"""What can go wrong between us and a device, split by what the caller must do.

    DriverError
    ├── PortError          the bytes do not flow
    │   ├── PortMissing       no such port: check the cable, keep trying
    │   ├── PortDenied        no permission: tell the user the cure
    │   ├── PortBusy          another program has it: tell the user which port
    │   ├── PortClosed        we closed it ourselves: stop quietly
    │   └── PortBroken        it went away under us (unplugged): reopen
    └── DeviceError        the bytes flow, the device is not as it should be
        ├── WrongDevice       something else answers on this port: tell the user what
        └── DeviceFault       the device reports a fault of its own (laser, motor): tell the user

A bad frame is an event, never an exception.
"""


class DriverError(Exception):
    """Root of the tree."""


class PortError(DriverError):
    """Bytes do not flow."""


class PortMissing(PortError):
    """There is no such port."""


class PortDenied(PortError):
    """The port exists, but this user may not open it."""


class PortBusy(PortError):
    """Another program holds the port."""


class PortClosed(PortError):
    """The port was closed by us."""


class PortBroken(PortError):
    """The port went away while in use."""


class DeviceError(DriverError):
    """Bytes flow, but the device is not as it should be."""


class WrongDevice(DeviceError):
    """Another kind of device answers on this port; the text says what it sent."""


class DeviceFault(DeviceError):
    """The device reports a fault of its own."""
