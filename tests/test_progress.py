"""The progress display on a stream that is not a terminal, and on one that is."""

from __future__ import annotations

import io
import re

import pytest

from bench.display_units import of_labels
from bench.progress import PlainProgress, shown_on
from bench.progress_text import clock_text


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


def test_more_steps_than_were_foreseen_are_counted_alone() -> None:
    """Not as "step 3/2": `sensitivity` finds out while it runs how many peaks it looks at again."""
    stream = io.StringIO()
    progress = PlainProgress(stream)
    progress.total(2)
    for _ in range(3):
        progress.step("inject")
    assert [line.split(":")[0] for line in stream.getvalue().splitlines()] == ["step 1/2", "step 2/2", "step 3"]


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
    assert "1/4" in shown
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
    assert of_labels(labels) == ("speed 10000 r/min, z -60 µm, angle 45°, judged, n 2, period 0.125 s, low 0 µm")


def test_a_load_and_its_branch_are_told_in_words() -> None:
    assert of_labels({"angle_rad": 0.0, "load": "M1", "branch": -1}) == "angle 0°, M1, unloading"
    assert of_labels({"name": "y", "value": 1e-5}) == "y 10 µm"
    assert of_labels({"name": "theta", "value": 1e-4}) == "theta 100 µrad"
    assert of_labels({"load": "", "branch": 1, "again": False}) == "no load, loading"


LABELS = "passage direction up, acceleration 234 r/min/s, from 598.1 r/min, to 14000 r/min, variant compensated"


@pytest.mark.parametrize("width", [80, 200])
def test_a_line_of_progress_fits_with_its_count_and_its_time_left(width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    stream = Terminal()
    with shown_on(stream) as progress:
        progress.stage("[6/8] bring the rig to LEVITATED")
        progress.total(120)
        for _ in range(3):
            progress.step(LABELS)
    drawn = [re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", line) for line in re.split(r"[\r\n]", stream.getvalue())]
    drawn = [line for line in drawn if "3/120" in line]
    assert drawn
    assert all(len(line) <= width and "left" in line and "passage direction up" in line for line in drawn)
    assert all((LABELS in line) == (width == 200) for line in drawn)


def test_a_question_takes_the_bar_down_and_is_broken_between_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    what = "The shaft is landed and stands. Weigh out 0.145 g and fix it in the inboard balancing plane at 273.0°."
    question = f"{what}\nPress Enter"
    stream = Terminal()
    with shown_on(stream) as progress:
        progress.stage("acquire")
        progress.total(4)
        progress.step("mount")
        with progress.asking(question):
            before = len(stream.getvalue())
        progress.step("on")
    asked = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", stream.getvalue()[:before]).splitlines()
    place = next(n for n, line in enumerate(asked) if line.startswith("The shaft is landed"))
    assert [line.strip() for line in asked[place - 2 : place]] == ["", "acquire 1/4"]
    assert all(len(line) <= 80 for line in asked)
    assert " ".join(asked[place : place + 2]) == what
    assert asked[place + 2 :] == ["Press Enter", "> "]


def test_a_part_in_which_nothing_moves_is_shown_and_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    stream = Terminal()
    with shown_on(stream) as progress:
        with progress.busy("analyse"):
            assert "0:00:00" in stream.getvalue()
        progress.step("on")
    assert "analyse" in stream.getvalue()
