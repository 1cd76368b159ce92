"""What becomes of the drive when the bench hangs, or its line is lost while it is being stopped."""

from __future__ import annotations

import threading

from fieldbus_bench import opened, rig

from bench.cli.safety import making_safe
from bench.cli.witness import RESTING
from bench.clock import WallClock
from bench.errors import LinkError
from bench.rigfile.envelope import Envelope
from bench.rigfile.registers import RegisterPort, Table, Words
from bench.run.job import WatchedClock
from drivers.fieldbus import LEASE_S
from drivers.open_devices import open_devices

COAST = (0, (0,))


def test_a_bench_that_hangs_polls_no_more_until_it_pumps() -> None:
    with opened(up=False) as (bench, bus):
        polls, line = tuple(bus._polls.values()), bench.lines["drive"]
        bus.pump()
        bench.clock.sleep(0.2)
        bus._pumped_s -= LEASE_S
        line.reads.clear()
        assert not bus._poll_leased(polls)
        assert line.reads == []
        bus._threaded = True  # pump itself polls nothing then
        bus.pump()
        assert bus._poll_leased(polls)
        assert line.reads != []


def test_a_run_command_whose_answer_was_lost_is_taken_back() -> None:
    with opened() as (bench, bus):
        assert bus.drive is not None
        bus.drive.set_speed(20.0)
        bus.devices["drive"].command("run")  # and no poll since
        assert not bus.drive.running
        base = WatchedClock(bench.machine, lambda: None, lambda _: None)
        at_once, wait, land, *_ = making_safe(bench.controller, base, bus.drive)[0]
        bench.lines["drive"].writes.clear()
        at_once.action()
        assert bench.lines["drive"].writes == [COAST]
        assert bench.bank.drives["drive"].state == "off"
        wait.action()  # the drive is seen off in it
        bench.lines["drive"].writes.clear()
        land.action()
        assert bench.lines["drive"].writes == []


def test_a_drive_that_nobody_saw_off_is_told_again_in_later_steps() -> None:
    with opened() as (bench, bus):
        assert bus.drive is not None
        bus.drive.reach(10.0)
        line = bench.lines["drive"]
        base = WatchedClock(bench.machine, lambda: None, lambda _: None)
        at_once, wait, land, *_ = making_safe(bench.controller, base, bus.drive)[0]
        bus.guarded = bench.controller.guarded = False
        line.failure = LinkError("no answer")
        line.writes.clear()
        at_once.action()
        assert line.writes == [COAST]
        line.failure = None
        wait.action()  # its line is there again
        assert bench.controller.mode != "SPINNING"
        assert line.writes[1] == COAST
        assert bench.bank.drives["drive"].state == "off"
        line.failure = LinkError("no answer")
        land.action()
        assert bench.controller.mode in RESTING


class Stuck:
    """A live port whose reads hang once told to, as on a dead line; what is written is kept."""

    def __init__(self, port: RegisterPort, hang: threading.Event, gate: threading.Event) -> None:
        self._port, self._hang, self._gate = port, hang, gate
        self.writes: list[tuple[int, Words]] = []
        self.held, self.ended, self.late = threading.Event(), threading.Event(), False

    def read(self, table: Table, address: int, count: int) -> Words:
        if self._hang.is_set():
            self.held.set()
            self._gate.wait(60.0)
        return self._port.read(table, address, count)

    def write(self, address: int, words: Words) -> None:
        self.writes.append((address, words))
        self.late = self.ended.is_set()


def test_the_last_coast_does_not_wait_for_a_poll_that_hangs() -> None:
    hang, gate = threading.Event(), threading.Event()
    with opened(up=False) as (bench, _):
        ports = {n: Stuck(bench.bank.port(n), hang, gate) for n in bench.bank.devices}
        try:
            with open_devices(rig(), ports.__getitem__, WallClock(), Envelope(rig()), threaded=True) as bus:
                bus.pump()
                ports["drive"].ended = bus._ended
                hang.set()
                assert any(port.held.wait(20.0) for port in ports.values())
            assert ports["drive"].writes == [COAST]
            assert not ports["drive"].late  # polling had not been ended yet
        finally:
            gate.set()
