"""One attempt to bring a sensor, in whatever state it is, to streaming scans."""

from lemtomap.drivers.hokuyo import commands
from lemtomap.drivers.hokuyo.codec import Reply
from lemtomap.drivers.hokuyo.events import SensorInfo
from lemtomap.drivers.hokuyo.packets import (
    ACCEPTED,
    ClockReading,
    Info,
    ScanFrame,
    SensorParameters,
    Status,
    explain_status,
)
from lemtomap.drivers.hokuyo.scans import ScanMaker, View
from lemtomap.drivers.hokuyo.steps import QUESTIONS, HandshakeStep
from lemtomap.drivers.hokuyo.timesync import TimeSync

_UNDEFINED = "0E"
_BUSY = "0B"
_TIME_MODE_TRIES = 2


class Connection:
    """Walks the steps; `command` says what to send, `answer` takes what came back."""

    def __init__(self, view: View, time_readings: int, version: Info | None, *, ask_version: bool) -> None:
        self.step = HandshakeStep.QUIET
        self._tries = 0
        self._overdue_s = float("-inf")
        self._sent_s = 0.0
        self.failure = ""
        self.failure_code = ""
        self.info: SensorInfo | None = None
        self.sync = TimeSync()
        self.version = version
        self._view = view
        self._time_readings = time_readings
        self._ask_version = ask_version
        self._maker: ScanMaker | None = None
        self._switched = False
        self._left_time = 0

    @property
    def maker(self) -> ScanMaker:
        """What turns this sensor's frames into scans, known from the step STATE on."""
        if self._maker is None:
            raise RuntimeError("the sensor's parameters are not known before step STATE")
        return self._maker

    def command(self, now_s: float) -> bytes:
        """Return what to send now: the step's command, again when its answer is overdue, or nothing."""
        while self.step in QUESTIONS and now_s >= self._overdue_s:
            question = QUESTIONS[self.step]
            if self._tries < question.tries:
                self._tries += 1
                self._overdue_s = now_s + question.timeout_s
                if self._tries == 1:
                    self._sent_s = now_s
                return self._start_command() if self.step is HandshakeStep.START else question.command
            self._give_up()
        return b""

    def answer(self, reply: Reply, now_s: float) -> None:
        """Take a reply; what does not answer the step's question is somebody else's, or late."""
        if isinstance(reply, ScanFrame):
            if self.step is HandshakeStep.START and self.maker.answers_request(reply):
                self._go(HandshakeStep.STREAM)  # the reply that accepted the command was lost
        elif isinstance(reply, ClockReading):
            if self.step is HandshakeStep.READ_TIME:
                self._take_time(reply, now_s)
        elif isinstance(reply, Info | Status) and self._answers_step(reply.command):
            self._take(reply)

    def _answers_step(self, echo: str) -> bool:
        return self.step in QUESTIONS and echo.startswith(QUESTIONS[self.step].echo)

    def rearm(self) -> None:
        """Ask for the next run of scans."""
        self._go(HandshakeStep.START)

    def _go(self, step: HandshakeStep) -> None:
        if step is HandshakeStep.VERSION and not self._ask_version:
            step = HandshakeStep.PARAMETERS
        self.step = step
        self._tries = 0
        self._overdue_s = float("-inf")
        self._sent_s = 0.0

    def _fail(self, reason: str, code: str = "") -> None:
        self.failure, self.failure_code = reason, code
        self.step = HandshakeStep.FAILED

    def _give_up(self) -> None:
        following = QUESTIONS[self.step].unanswered
        if self.step is HandshakeStep.QUIET and self._switched:
            following = HandshakeStep.FAILED
        if self.step is HandshakeStep.STATE:
            self._take_state(None)
        elif following is not HandshakeStep.FAILED:
            self._go(following)
        elif self.step in {HandshakeStep.QUIET, HandshakeStep.SWITCH}:
            self._fail("the laser does not answer: check the cable, or unplug it and plug it in again")
        else:
            self._fail(f"the laser answers, but not {QUESTIONS[self.step].echo}")

    def _take(self, reply: Info | Status) -> None:  # noqa: C901  # one case for each step
        refused = isinstance(reply, Status) and reply.status != ACCEPTED
        match self.step:
            case HandshakeStep.QUIET if (
                refused and isinstance(reply, Status) and reply.status.startswith("E")
            ):
                self._go(HandshakeStep.SWITCH)
            case HandshakeStep.QUIET:
                self._go(HandshakeStep.LEAVE_TIME)
            case (
                HandshakeStep.SWITCH
            ):  # `0` from a sensor that switched, `0E` from one that speaks nothing else
                self._switched = True
                self._go(HandshakeStep.QUIET)
            case HandshakeStep.LEAVE_TIME:
                self._go(HandshakeStep.RESET)
            case HandshakeStep.RESET:
                self._go(HandshakeStep.VERSION)
            case HandshakeStep.VERSION:
                self.version = reply if isinstance(reply, Info) else None
                self._go(HandshakeStep.PARAMETERS)
            case HandshakeStep.ENTER_TIME:  # 02: already there; anything else: this sensor does not do it
                known = isinstance(reply, Status) and reply.status in {ACCEPTED, "02"}
                self._go(HandshakeStep.READ_TIME if known else HandshakeStep.START)
            case HandshakeStep.READ_TIME:
                self._go(HandshakeStep.END_TIME)
            case HandshakeStep.END_TIME:
                self._go(HandshakeStep.START)
            case _ if isinstance(reply, Status):
                self._take_status(reply)
            case HandshakeStep.PARAMETERS:
                self._take_parameters(reply)
            case HandshakeStep.STATE:
                self._take_state(reply)

    def _take_status(self, reply: Status) -> None:
        """PP, II or MD: only MD may be answered by a status alone."""
        if self.step is HandshakeStep.START and reply.status == ACCEPTED:
            self._go(HandshakeStep.STREAM)
        elif reply.status == _UNDEFINED and self._left_time < _TIME_MODE_TRIES:
            self._left_time += 1
            self._go(HandshakeStep.LEAVE_TIME)
        elif self.step is HandshakeStep.STATE:
            self._take_state(None)
        elif reply.status != _BUSY:  # busy: ask again when the answer is overdue
            self._fail(f"{reply.command} is refused: {explain_status(reply.status)}", reply.status)

    def _take_parameters(self, reply: Info) -> None:
        if reply.doubtful:
            self._overdue_s = float("-inf")  # damaged on the way: ask again at once
            return
        try:
            sensor = SensorParameters.from_fields(reply.fields)
            self._maker = ScanMaker(sensor, self._view.request(sensor))
        except ValueError as error:
            self._fail(str(error))
            return
        self._go(HandshakeStep.STATE)

    def _take_state(self, reply: Info | None) -> None:
        told = dict(self.version.fields) if self.version is not None else {}
        state = {} if reply is None else {k: v for k, v in reply.fields.items() if k not in reply.doubtful}
        self.info = SensorInfo(
            vendor=told.get("VEND", ""),
            product=told.get("PROD", ""),
            firmware=told.get("FIRM", ""),
            protocol=told.get("PROT", ""),
            serial=told.get("SERI", ""),
            parameters=self.maker.sensor,
            state=state,
        )
        self._go(HandshakeStep.ENTER_TIME)

    def _take_time(self, reply: ClockReading, now_s: float) -> None:
        self.sync.add(reply.stamp_ms, self._sent_s, now_s)
        self._go(HandshakeStep.READ_TIME if self.sync.count < self._time_readings else HandshakeStep.END_TIME)

    def _start_command(self) -> bytes:
        return commands.stream(self.maker.request)
