"""A person at the terminal, who takes his time: lines without waiting, and a rotor that stays up meanwhile."""

from __future__ import annotations

import os

import pytest

from bench.cli import console
from bench.errors import OperatorAbort


class Waiting:
    """A clock that does something when it is slept on."""

    def __init__(self, *what: bytes) -> None:
        self.reader, self.writer = os.pipe()
        self.what, self.slept = list(what), 0.0

    def now_ns(self) -> int:
        return round(self.slept * 1e9)

    def sleep(self, seconds: float) -> None:
        self.slept += seconds
        if self.what:
            os.write(self.writer, self.what.pop(0))
        else:
            os.close(self.writer)


def test_lines_come_whole_and_one_at_a_time() -> None:
    clock = Waiting(b"ye", "s\nsöcond\nno".encode())
    keyboard = console.Keyboard(clock.reader)
    found = []
    for _ in range(6):
        found.append(keyboard.line())
        if found[-1] is None:
            clock.sleep(0.05)
    assert found == [None, None, "yes\n", "söcond\n", None, "no"]
    assert keyboard.line() == ""
    os.close(clock.reader)


def test_time_goes_on_until_the_answer(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    clock = Waiting(b"", b"", b"done\n")
    with os.fdopen(clock.reader) as pipe:
        monkeypatch.setattr("sys.stdin", pipe)
        ask = console.attentive(clock)
        assert ask("Hang M1: ") == "done\n"
        assert clock.slept == pytest.approx(3 * console.LOOK_S)
        with pytest.raises(OperatorAbort, match="standard input is closed"):
            ask("Hang M2: ")
    assert capsys.readouterr().err == "Hang M1: \nHang M2: \n"
