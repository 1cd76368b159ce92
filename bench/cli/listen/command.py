"""`bench listen`: open the controller's link, hear, show, keep. A part of the composition root; nothing here can send."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from bench import units
from bench.cli.compose import with_links
from bench.cli.listen.screen import line, screen
from bench.cli.listen.summary import summary
from bench.cli.listen.unfinished import listenable
from bench.cli.listen.words import told_unit
from bench.clock import WallClock
from bench.errors import LinkError
from bench.link.listened import Ear, Listened
from bench.link.troubles import Trouble, troubles
from bench.os_signals import delivered_to
from bench.rigfile import RigFile

if TYPE_CHECKING:
    from bench.recording.recorder import Recorder
    from drivers.listener import Listener
    from drivers.polling import Reading
    from drivers.register_reading import RegisterReading

LOOK_S, DRAWN_S = 0.05, 0.25
OFTEN_S, SOMETIMES_S = 10.0, 60.0  # lines come every second, then every ten, then every minute
ERROR = 3


@dataclass(frozen=True)
class ListenRequest:
    """What is to be heard, as it was asked for. `seconds`: None until Ctrl-C."""

    rig: str
    links: tuple[str, ...] = ()
    seconds: float | None = None
    record: bool = False
    out: Path = Path("runs")
    poll: bool = False
    acknowledge: bool = False


def listen_command(request: ListenRequest) -> int:
    """Listen until Ctrl-C or for so long; the summary on standard output, with a recording its directory as the last line.

    Returns:
        0; 3 where the link was lost, or no telemetry came within the time that was asked for.

    Raises:
        ConfigError: usage, rig file, or the port or interface cannot be opened.
        RecordingError: the recording cannot be written.
    """
    file, unfinished = listenable(request.rig)
    rig = with_links(file, request.links)
    if unfinished:
        sys.stderr.write(
            f"{file.path} has {unfinished} problems that do not hinder listening: `bench check {request.rig}`\n"
        )
    clock, stopped = WallClock(), list[str]()
    with ExitStack() as stack:
        stack.enter_context(delivered_to(stopped.append))
        session = _opened(rig, request, clock, stack)
        kept = _kept(request, session, stack)
        lost = ""
        try:
            with _shown() as show:
                session.listen(show, lambda: bool(stopped) or _over(request, session.heard), clock)
        except LinkError as error:
            lost = str(error)
        found = troubles(session.heard)
    sys.stdout.write(summary(session.heard, found, session.devices, _columns()))
    if lost:
        sys.stderr.write(f"bench: {lost}\n")
    if kept is not None:
        sys.stdout.write(f"{kept}\n")
    nothing = (
        request.seconds is not None and not stopped and not session.heard.census.of(session.heard.census.telemetry[0])
    )
    return ERROR if lost or nothing else 0


def _over(request: ListenRequest, heard: Listened) -> bool:
    return request.seconds is not None and heard.seconds >= request.seconds


Show = Callable[["Session"], None]


@dataclass
class Session:
    """What is listened to, and what was heard; `devices` is what the register devices say, a line each."""

    rig: RigFile
    listener: Listener
    heard: Listened
    reading: RegisterReading | None = None
    recorder: Recorder | None = None
    devices: dict[str, str] = field(default_factory=dict)

    def listen(self, show: Show, over: Callable[[], bool], clock: WallClock) -> None:
        """Look, show, until it is over.

        Raises:
            LinkError: the link is lost.
            RecordingError: the recording cannot be written.
        """
        drawn_ns = 0
        while not over():
            clock.sleep(LOOK_S)
            self.look(clock.now_ns())
            if clock.now_ns() - drawn_ns >= DRAWN_S * 1e9:
                drawn_ns = clock.now_ns()
                show(self)

    def look(self, now_ns: int) -> None:
        """Take what came; raw frames are recorded first."""
        batch = self.listener.receive()
        if self.recorder is not None:
            self.recorder.frames(self.listener.name, batch, lag_ns=self.heard.decoder.host.lag_ns)
        blocks = self.heard.take(batch, self.listener.stats, now_ns)
        if self.reading is not None:
            readings, polled = self.reading.take()
            blocks += polled
            self.devices.update((r.device, _device_line(self.rig, r)) for r in readings)
        if self.recorder is not None:
            for block in blocks:
                self.recorder.samples(block)


def _opened(rig: RigFile, request: ListenRequest, clock: WallClock, stack: ExitStack) -> Session:
    """The link, and the register devices where they are to be asked."""
    from drivers.listener import Listener
    from drivers.reception import open_reception

    name = rig.devices["controller"].link
    sys.stderr.write(f"listening to {rig.name} on {name}, {rig.link.url}: nothing is sent; Ctrl-C ends\n")
    reception = open_reception(rig.link, name, clock.now_ns, acknowledge=request.acknowledge, rig=rig)
    listener = Listener(name, reception)
    stack.callback(listener.close)
    ear = Ear(name, rig.link.url, listener.manner, clock.now_ns(), listener.complaint)
    session = Session(rig, listener, Listened(rig, ear))
    registers = [n for n, d in rig.devices.items() if d.registers]
    if request.poll and registers:
        from drivers.register_reading import RegisterReading

        session.reading = RegisterReading(rig, clock)
        stack.callback(session.reading.close)
        session.devices.update(session.reading.unreachable)
    elif registers:
        sys.stderr.write(f"{', '.join(registers)}: not read, as reading registers is a request; --poll reads them\n")
    return session


def _kept(request: ListenRequest, session: Session, stack: ExitStack) -> Path | None:
    """Where it is recorded, if it is."""
    if not request.record:
        return None
    from bench.cli.listen.keeping import keeping

    streams = [session.heard.decoder.layout, *(session.reading.layouts if session.reading is not None else ())]
    directory, session.recorder = stack.enter_context(keeping(session.rig, request.out, WallClock(), streams))
    return directory.path


def _device_line(rig: RigFile, reading: Reading) -> str:
    if reading.values is None:
        return str(reading.error)
    registers = rig.devices[reading.device].registers
    told = []
    for name, value in reading.values.items():
        symbol, one = told_unit(units.UNITS[registers[name].unit].si, abs(value))
        told.append(f"{name} {value / one + 0.0:.4g} {symbol}".rstrip())
    return ", ".join(told)


def _columns() -> int:
    return max(shutil.get_terminal_size((80, 24)).columns, 60)


@contextmanager
def _shown() -> Iterator[Show]:
    """A screen that is drawn anew on a terminal, else lines."""
    if not sys.stdout.isatty():
        yield Lines().show
        return
    from rich.console import Console
    from rich.text import Text

    console = Console(file=sys.stdout)
    with console.screen(hide_cursor=True) as drawn:

        def show(session: Session) -> None:
            size = shutil.get_terminal_size((80, 24))
            lines = screen(session.heard, troubles(session.heard), session.devices, size.columns, size.lines)
            drawn.update(Text("\n".join(lines), no_wrap=True, overflow="crop"))

        yield show


class Lines:
    """A line now and then, and one for each thing that is wrong when it is first seen."""

    def __init__(self) -> None:
        self._told: set[str] = set()
        self._next_s = 1.0

    def show(self, session: Session) -> None:
        """What is new."""
        heard = session.heard
        self._tell(heard, [t for t in troubles(heard) if t.key not in self._told])
        if heard.seconds >= self._next_s:
            passed = heard.seconds
            step = 1.0 if passed < OFTEN_S else OFTEN_S if passed < SOMETIMES_S else SOMETIMES_S
            self._next_s = (passed // step + 1) * step
            self._write(line(heard))

    def _tell(self, heard: Listened, new: list[Trouble]) -> None:
        for trouble in new:
            self._told.add(trouble.key)
            self._write(f"{heard.seconds:5.0f} s  ! {trouble.text}")

    def _write(self, text: str) -> None:
        sys.stdout.write(f"{text}\n")
        sys.stdout.flush()
