"""The laser on a port: session, clock and port joined."""

from collections.abc import Awaitable, Callable

from lemtomap.drivers.driver import (
    Driver,
    DriverConfig,
    PortLost,
    PortOpened,
)
from lemtomap.drivers.hokuyo.session import HokuyoEvent, HokuyoSession
from lemtomap.drivers.port import BytePort


class HokuyoDriver(Driver[HokuyoEvent]):
    """One laser. It connects, streams and recovers by itself; all there is to do is to take its events."""

    def __init__(
        self,
        open_port: Callable[[], Awaitable[BytePort]],
        clock: Callable[[], float],
        on_event: Callable[[HokuyoEvent | PortOpened | PortLost], None],
        session: HokuyoSession | None = None,
        config: DriverConfig | None = None,
    ) -> None:
        self.session = session or HokuyoSession()
        super().__init__(open_port, self.session, clock, on_event, config)
