"""The Kobuki on a port: session, clock and port joined."""

from collections.abc import Awaitable, Callable

from lemtomap.drivers.driver import (
    Driver,
    DriverConfig,
    PortLost,
    PortOpened,
)
from lemtomap.drivers.kobuki.session import KobukiEvent, KobukiSession
from lemtomap.drivers.port import BytePort


class KobukiDriver(Driver[KobukiEvent]):
    """One base. Commands are sent at once, or dropped while there is no port: never kept for later."""

    def __init__(
        self,
        open_port: Callable[[], Awaitable[BytePort]],
        clock: Callable[[], float],
        on_event: Callable[[KobukiEvent | PortOpened | PortLost], None],
        session: KobukiSession | None = None,
        config: DriverConfig | None = None,
    ) -> None:
        self.session = session or KobukiSession()
        super().__init__(open_port, self.session, clock, on_event, config)

    def drive(self, v_mps: float, w_radps: float) -> bool:
        """Send a velocity; repeat it every 20 ms. Raises ValueError if not finite."""
        return self.write(self.session.drive(v_mps, w_radps))

    def stop(self) -> bool:
        """Send a stop."""
        return self.write(self.session.stop_bytes())
