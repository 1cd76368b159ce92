"""What is heard as a screen of lines, for 80 columns and more, drawn anew several times a second; and as a line a second."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

from bench.cli.listen.words import clock, rate, shown
from bench.link.listened import Listened
from bench.link.stillness import CODES
from bench.link.troubles import Trouble, remark

NAME, VALUE, UNIT = 12, 7, 5  # columns of a cell at most; a mark stands behind
MARKS = {"": " ", "stands": "=", "never came": "?"}  # of remarks; any other is told under the head
LEGEND = "= reads the same all the time   ? never came   ! see above   Ctrl-C ends"
FEWEST_ROWS = 8
Devices = Mapping[str, str]
"""By register device what it says, as a line."""


def screen(heard: Listened, found: Sequence[Trouble], devices: Devices, columns: int, rows: int) -> list[str]:
    """Lines that fit: the head, what is wrong, the channels side by side."""
    columns, rows = max(columns, 20), max(rows, FEWEST_ROWS)
    lines = head(heard)
    told = [line for t in found for line in _wrapped(f"! {t.text}", columns)]
    grid = _grid(heard, columns)
    polled = [f"{name}: {text}" for name, text in devices.items()]
    room = rows - len(lines) - 2  # a line between, and the legend
    most = max(room // 2, room - len(grid) - len(polled))
    lines += (
        told if len(told) <= most else [*told[: most - 1], f"! more is wrong: {len(found)} things in all, at the end"]
    )
    below = [*grid, *polled]
    room = rows - len(lines) - 2
    lines += ["", *(below if len(below) <= room else [*below[: room - 1], "... more channels: all are in the summary"])]
    return [text[:columns] for text in (*lines, LEGEND)]


def head(heard: Listened) -> list[str]:
    """Where and how is listened, telemetry, state, frames."""
    c = heard.decoder.counters
    state, fault = heard.readings.code("state") or "-", heard.readings.code("fault") or "-"
    mode = heard.rig.binding.mode(state)
    meaning = f" ({mode})" if mode and mode != state else ""
    hosts = ", ".join(f"{m.name} {rate(t.rate_hz(heard.now_ns))}" for m, t in heard.census.of_hosts) or "none heard"
    lost, leapt = (c.lost, c.sequence_leaps + c.tick_leaps) if heard.consistent else ("?", "?")
    seen = f"{rate(heard.rate_hz)} of {rate(heard.due_hz)}"
    return [
        f"{heard.rig.name}  {heard.seconds:.0f} s  {heard.ear.link}: {heard.ear.url}",
        heard.ear.manner,
        f"telemetry  {seen}   lost {lost}   leapt {leapt}   tick {clock(heard)}",
        f"state      {state}{meaning}   fault {fault}{'   A SIMULATION' if heard.census.simulated else ''}",
        f"frames     {heard.frames}   unknown {heard.census.strange}   errors {_errors(heard)}   another host: {hosts}",
    ]


def _errors(heard: Listened) -> int:
    s = heard.stats
    return s.error_frames + s.crc_errors + s.malformed + s.packets_lost + s.adapter_overruns + s.overflows


def line(heard: Listened) -> str:
    """The same in one line."""
    state, fault = heard.readings.code("state") or "-", heard.readings.code("fault") or "-"
    c = heard.decoder.counters
    counts = (
        f"telemetry {rate(heard.rate_hz)}  lost {c.lost if heard.consistent else '?'}  unknown {heard.census.strange}"
    )
    return f"{heard.seconds:5.0f} s  {counts}  {state}  fault {fault}"


def _grid(heard: Listened, columns: int) -> list[str]:
    """Channels but the codes, column by column."""
    readings = {n: r for n, r in heard.readings.by_name.items() if n not in CODES[:2]}
    wide = min(NAME, max(len(n) for n in readings))
    cells = []
    for name, reading in readings.items():
        value, symbol = shown(name, reading, heard)
        mark = MARKS.get(remark(reading), "!")
        cells.append(f"{_cut(name, wide):{wide}} {value:>{VALUE}} {symbol:{UNIT}} {mark}")
    side_by_side = max(1, (columns + 1) // (len(cells[0]) + 1))
    tall = -(-len(cells) // side_by_side)
    return [" ".join(cells[k::tall]).rstrip() for k in range(tall)]


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[: width - 1] + "…"


def _wrapped(text: str, columns: int) -> list[str]:
    return textwrap.wrap(text, columns, subsequent_indent="  ", break_on_hyphens=False)
