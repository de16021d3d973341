"""The robot in real time: who runs what in which thread.

    loop thread     both drivers, the velocity output and the safety gate; it never waits for anything else
    mapping         one scan after another
    navigation      10 times a second
    onlooker        viewer and recorder; may be late, slows nobody

Whatever ends the run (mission over, time up, Ctrl-C, SIGTERM, SIGHUP, a full disk, a crash in any thread),
the last bytes are a stop.
"""

import asyncio
import sys
import threading
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from lemtomap.drivers.driver import PortLost, PortOpened
from lemtomap.drivers.hokuyo.driver import HokuyoDriver
from lemtomap.drivers.hokuyo.session import HokuyoEvent
from lemtomap.drivers.kobuki.driver import KobukiDriver
from lemtomap.drivers.kobuki.session import KobukiEvent
from lemtomap.drivers.port import BytePort
from lemtomap.robot.clock import Clock, MonotonicClock, stamp_ns
from lemtomap.robot.core import RobotCore, Samples
from lemtomap.robot.devices.indicators import Signal, signal_bytes
from lemtomap.robot.devices.recording import (
    HOKUYO,
    KOBUKI,
    LOST,
    OPENED,
    Call,
    RecordedCall,
)
from lemtomap.robot.devices.wire import RecordedHokuyoSession, RecordedKobukiSession
from lemtomap.robot.exchange import Ended, MissionState, NoteLevel
from lemtomap.robot.missions.missions import Mission
from lemtomap.robot.output.onlooker import LOOK_PERIOD_S, Onlooker
from lemtomap.robot.runs.interrupts import on_interrupt

OUTPUT_PERIOD_S = 0.02  # design, section 4
SHORTEST_NAP_S = 0.001  # a busy machine gives no shorter one
LONGEST_NAP_S = 0.025  # a packet comes every 20 ms, now and then a little later
SETTLE_S = 1.0  # after a mission: the last scans, a standing robot
JOIN_S = 5.0
SWITCH_S = (
    0.001  # Python's threads hand over five times as often as usual, so that a stop never waits for a map
)

OpenPort = Callable[[], Awaitable[BytePort]]
AnyEvent = KobukiEvent | HokuyoEvent | PortOpened | PortLost


@dataclass(frozen=True, slots=True)
class Ports:
    """How to open the two ports."""

    kobuki: OpenPort
    hokuyo: OpenPort


class Runtime:
    """One run."""

    def __init__(self, core: RobotCore, ports: Ports, onlooker: Onlooker, clock: Clock | None = None) -> None:
        self.core, self.onlooker = core, onlooker
        self.clock: Clock = clock or MonotonicClock()
        self.stop = threading.Event()
        """Set it from any thread to end the run."""
        record = onlooker.raw.put
        devices, now_s = core.devices, self.clock.now_s
        base = RecordedKobukiSession(record, devices.kobuki)
        laser = RecordedHokuyoSession(record, devices.hokuyo)
        self._kobuki = KobukiDriver(ports.kobuki, now_s, self._on_base, base, devices.waiting)
        self._hokuyo = HokuyoDriver(ports.hokuyo, now_s, self._on_laser, laser, devices.waiting)
        self._base_events: list[KobukiEvent] = []
        self._laser_events: list[HokuyoEvent] = []
        self._lost: list[str] = []
        self._cycle_due_s = 0.0
        self._cycle_due = False
        self._crash: BaseException | None = None
        self._interrupted = False

    def run(self, mission: Mission, duration_s: float) -> Ended:
        """Run until the mission is over, the time is up or somebody stops it. Call it from the main thread.

        Raises PortError or WrongDevice when a port cannot be opened at first, and whatever crashed a thread.
        """
        self.core.navigation.set_mission(mission)
        switch_s = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_S)
        threads = [
            threading.Thread(target=self._guard, args=(name, work), name=name, daemon=True)
            for name, work in (
                ("mapping", self._map),
                ("navigation", self._navigate),
                ("onlooker", self._look),
            )
        ]
        with on_interrupt(self._interrupt), self.core.efforts.threads.running():
            try:
                return asyncio.run(self._loop(threads, duration_s))
            finally:
                self.stop.set()
                for thread in threads:
                    if thread.ident is not None:
                        thread.join(JOIN_S)
                if not threads[-1].is_alive():  # a stuck disk holds it: then nothing more is taken
                    self.onlooker.look(self.clock.now_s())
                sys.setswitchinterval(switch_s)

    def _interrupt(self) -> None:
        """End the run: somebody wants it."""
        self._interrupted = True
        self.stop.set()

    # ---- the loop thread ----

    async def _loop(self, threads: list[threading.Thread], duration_s: float) -> Ended:
        with self.core.efforts.threads.thread("base"):
            return await self._drive(threads, duration_s)

    async def _drive(self, threads: list[threading.Thread], duration_s: float) -> Ended:
        drivers = [asyncio.create_task(self._kobuki.run()), asyncio.create_task(self._hokuyo.run())]
        output = asyncio.create_task(self._output(duration_s))
        for thread in threads:
            thread.start()
        try:
            self.core.permit()
            await asyncio.wait({output, *drivers}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self.core.halt()
            self._kobuki.stop()
            for task in (output, *drivers):
                task.cancel()
            await asyncio.gather(output, *drivers, return_exceptions=True)
        self._raise_first(output, *drivers)
        return self._ended()

    async def _output(self, duration_s: float) -> None:
        """Command the base: with each packet, and every 20 ms when none comes."""
        end_s = self.clock.now_s() + duration_s
        while not self.stop.is_set() and self.clock.now_s() < end_s:
            nap_s = self._cycle_due_s - self.clock.now_s()
            await asyncio.sleep(min(max(nap_s, SHORTEST_NAP_S), LONGEST_NAP_S))
            if self.clock.now_s() >= self._cycle_due_s:
                self._cycle(OUTPUT_PERIOD_S)
            status = self.core.exchange.mission.get()
            if status is not None and status.state.over:
                end_s = min(end_s, status.stamp_s + SETTLE_S)

    def _on_base(self, event: AnyEvent) -> None:
        if isinstance(event, PortOpened | PortLost):
            self._port_changed(KOBUKI, event)
            return
        self._base_events.append(event)  # type: ignore[arg-type]
        self._soon()

    def _soon(self) -> None:
        """Command the base as soon as the whole packet is taken, before anything else."""
        if not self._cycle_due:
            self._cycle_due = True
            asyncio.get_running_loop().call_soon(self._cycle, LONGEST_NAP_S)

    def _on_laser(self, event: AnyEvent) -> None:
        if isinstance(event, PortOpened | PortLost):
            self._port_changed(HOKUYO, event)
        else:
            self._laser_events.append(event)  # type: ignore[arg-type]

    def _cycle(self, patience_s: float) -> None:
        """Run the base once; without a packet it is due again after so long."""
        self._cycle_due = False
        now_s = self.clock.now_s()
        self._cycle_due_s = now_s + patience_s
        samples = Samples(self._base_events, self._laser_events, self._lost)
        self._base_events, self._laser_events, self._lost = [], [], []
        self.core.take(samples, now_s)
        commands = self.core.command(now_s)
        self._send(self._kobuki.session.drive(commands.drive.v_mps, commands.drive.w_radps), now_s)
        for signal in commands.signals:
            self._signal(signal, now_s)

    def _signal(self, signal: Signal, now_s: float) -> None:
        self._send(signal_bytes(self._kobuki.session, signal), now_s)

    def _send(self, data: bytes, now_s: float) -> None:
        if self._kobuki.write(data):
            self.onlooker.raw.put(RecordedCall(KOBUKI, Call.SEND, stamp_ns(now_s), data))

    def _port_changed(self, device: str, event: PortOpened | PortLost) -> None:
        opened = isinstance(event, PortOpened)
        self.onlooker.raw.put(
            RecordedCall(device, Call.PORT, stamp_ns(event.stamp_s), OPENED if opened else LOST)
        )
        if isinstance(event, PortLost):
            self._lost.append(device)
            self._soon()
            self.core.exchange.note(event.stamp_s, device, str(event.error), NoteLevel.WARN)

    def _raise_first(self, *tasks: "asyncio.Task[None]") -> None:
        if self._crash is not None:
            raise self._crash
        for task in tasks:
            error = None if task.cancelled() else task.exception()
            if error is not None:
                raise error

    def _ended(self) -> Ended:
        status, now_s = self.core.exchange.mission.get(), self.clock.now_s()
        state, text = (status.state, status.text) if status else (MissionState.WAITING, "no map yet")
        if self.onlooker.over:
            state, text = MissionState.FAILED, self.onlooker.over
        return Ended(now_s, state, text, self._interrupted, self.onlooker.over)

    # ---- the other threads ----

    def _guard(self, name: str, work: Callable[[], None]) -> None:
        """Run a thread's work; a crash ends the run."""
        try:
            with self.core.efforts.threads.thread(name):
                work()
        except BaseException as error:  # noqa: BLE001 -- kept, and raised in the main thread
            self._crash = self._crash or error
            self.core.halt()
            self.stop.set()

    def _map(self) -> None:
        while not self.stop.is_set():
            self.core.map_one(0.1)

    def _navigate(self) -> None:
        next_s = self.clock.now_s()
        while not self.stop.is_set():
            self.core.navigate(self.clock.now_s())
            next_s = max(next_s + self.core.navigation.navigator.config.period_s, self.clock.now_s())
            self.stop.wait(next_s - self.clock.now_s())

    def _look(self) -> None:
        while not self.stop.wait(LOOK_PERIOD_S):
            self.onlooker.look(self.clock.now_s())
            if self.onlooker.over:
                self.stop.set()
