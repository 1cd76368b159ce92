"""The progress display on a stream that is not a terminal, and on one that is."""

from __future__ import annotations

import io

import pytest

from bench.progress import PlainProgress, clock_text, described, shown_on


def test_plain_lines_are_few_and_say_step_and_time_left() -> None:
    stream, time = io.StringIO(), [0.0]
    progress = PlainProgress(stream, lambda: time[0])
    progress.stage("acquire")
    progress.total(80)
    for n in range(80):
        progress.step(f"hang M{n}")
        time[0] += 2.0
    lines = stream.getvalue().splitlines()
    assert lines[0] == "acquire"
    assert len(lines) == 21
    assert lines[1] == "step 1/80: hang M0"
    assert lines[11] == "step 41/80: hang M40, 01:20 left"


def test_an_unknown_total_gives_lines_without_a_time() -> None:
    stream = io.StringIO()
    progress = PlainProgress(stream)
    progress.step("hang")
    progress.step("hang")
    assert stream.getvalue() == "step 1: hang\nstep 2: hang\n"


@pytest.mark.parametrize(("seconds", "text"), [(0.4, "00:00"), (65, "01:05"), (3600 + 61, "1:01:01")])
def test_times_are_written_as_clocks(seconds: float, text: str) -> None:
    assert clock_text(seconds) == text


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_a_terminal_gets_a_bar_and_text_in_brackets_survives() -> None:
    stream = Terminal()
    with shown_on(stream) as progress:
        progress.stage("acquire")
        progress.total(4)
        progress.step("hang [M1]")
        progress.line("warning: [bold] is not markup")
    shown = stream.getvalue()
    assert "0/4" in shown
    assert "hang [M1]" in shown
    assert "[bold] is not markup" in shown


def test_a_pipe_gets_no_control_characters() -> None:
    stream = io.StringIO()
    with shown_on(stream) as progress:
        progress.stage("acquire")
        progress.total(4)
        progress.step("hang")
    assert "\x1b" not in stream.getvalue()


def test_labels_are_in_the_fields_units() -> None:
    labels = {"speed_rad_s": 1047.1975512, "z_m": -6e-5, "angle_rad": 0.7853981634, "judged": True, "name": "", "n": 2,
              "period_s": 0.125, "low_m": -0.0}  # fmt: skip
    assert described(labels) == (
        "speed 10000 r/min, z -60 µm, angle 45°, judged yes, name none, n 2, period 0.125 s, low 0 µm"
    )
