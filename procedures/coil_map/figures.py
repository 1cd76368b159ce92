"""What the map draws: systems against coils, and systems against axes, expected beside found."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import takewhile

import numpy as np

from bench.figures import Figure, Grid, Series, Sheet
from procedures.coil_map.estimates import Array, Result, asked, response

FEW = 6  # columns whose names have room
GAP = 1.0  # column between what was expected and what was found


def all_figures(r: Result) -> Iterator[Figure | Sheet]:
    """In the order of the report."""
    names = [f"{name} {way}" for name, way in r.rows]
    yield _pair("currents", "Currents of the coils", "Each coil's current of 1 A along d and q of each system, at the angle of "
                "the pulses: left as the winding gives it, right as it was read.", names, r.can.coils, r.expected, r.found,
                "current / A", "coil")  # fmt: skip
    caption = (
        "Left what a right winding moves, right what was seen: pulses around and along as a share of the greatest of that "
        "axis, aside as a share of the ring. A pulse aside shows as much as the mover can roll; which way the bearings push is "
        "in the next figures."
    )
    wanted = asked(r.can, r.rows)
    yield _pair("moves", "What each system moves", caption, names, r.can.axes, wanted, response(r), "share", "axis")
    for name, p in r.pushed.items():
        yield _around(name, r, p.places)
    yield table(r)


def _pair(key: str, title: str, caption: str, rows: list[str], columns: tuple[str, ...], one: Array, other: Array,
          label: str, what: str) -> Figure:  # fmt: skip
    """Two tables beside each other, one scale for both."""
    n = len(columns)
    values = np.hstack([one, np.full((len(rows), 1), np.nan), other])
    x = np.arange(values.shape[1], dtype=float)
    alike = [*takewhile(lambda letters: len({*letters}) == 1, zip(*columns, strict=False))]
    shared = len(alike) if n > FEW else 0  # of many only numbers, and not each, have room
    ticks = tuple(
        (columns[k][shared:], float(k + shift)) for shift in (0, n + int(GAP)) for k in range(0, n, 1 + n // FEW)
    )
    of = f" {columns[0][:shared]}…" if shared else ""
    return Figure(key, title, caption, f"{what}{of}: as it should be, and as found", "", (), ticks=ticks,
                  y_ticks=tuple((name, float(k)) for k, name in enumerate(rows)),
                  grid=Grid(x, np.arange(len(rows), dtype=float), values, label))  # fmt: skip


def _around(name: str, r: Result, places: Array) -> Figure:
    """Where the mover was while a push was turned around, in order."""
    p = r.pushed[name]
    um = 1e6 * places
    axes = r.can.systems[p.most].axes
    first = Series("first push: d", um[:1, 0], um[:1, 1], "mark")
    turn = Series("while the push turns from d to q", um[:, 0], um[:, 1], "both")
    at = np.linspace(0, 2 * np.pi, 90)
    ring = Series("ring, by the fit", 1e6 * (p.bowl.o[0] + p.bowl.c * np.cos(at)), 1e6 * (p.bowl.o[1] + p.bowl.c * np.sin(at)),
                  "guide")  # fmt: skip
    way = "against" if p.bowl.mirrored else "with"
    caption = (
        f"The mover in its ring while a push of {name} was turned around. Its d stands {np.degrees(p.bowl.angle):+.1f}° from "
        f"{axes[0]}, it turns {way} its current, and pushes {p.bowl.roundness:.2f} as hard in its weakest direction."
    )
    return Figure(f"around-{name}", f"A push of {name}, turned around", caption, f"{axes[0]} / µm", f"{axes[1]} / µm",
                  (turn, first, ring), kind="plane")  # fmt: skip


def table(r: Result) -> Sheet:
    """What was found of each radial system."""
    rows = tuple(
        (name, ", ".join(r.can.systems[p.most].axes), f"{np.degrees(p.bowl.angle):+.1f}°", "yes" if p.bowl.mirrored else "no",
         f"{p.bowl.roundness:.3f}", f"{np.hypot(*p.bowl.m):.3f}", f"{p.bowl.rest * 1e6:.2f} µm")
        for name, p in r.pushed.items()
    )  # fmt: skip
    header = ("system", "moves", "d stands off by", "mirrored", "least push", "of torque current", "fit")
    caption = (
        "Of each bearing current, turned around: which axes it moved most; how far d stands from the first, electrical; its "
        "least push over its greatest; what 1 A of torque current along d pushes, in A of it; what the fit leaves."
    )
    return Sheet("pushes", "Pushes of the bearing currents", caption, header, rows, (2, 4, 5, 6))
