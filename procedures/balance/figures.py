"""What a balancing draws: vectors of every run at the probes, weights on the planes' scales, what is left against U_per."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from bench.analysis.balance import G_MM
from bench.analysis.sampling import lag_deg
from bench.analysis.vectors import region
from bench.figures import Figure, Series, Sheet, Shown
from bench.units import RPM
from procedures.balance.estimates import Balanced, Result
from procedures.balance.planes import Plane
from procedures.balance.steps import BASE, Weight

Complex = npt.NDArray[np.complex128]
UM = 1e6
TURN = np.linspace(0, 2 * np.pi, 181)


def all_figures(found: Result) -> Iterator[Shown]:
    """In the order of the report."""
    balance = found.balance
    yield _weights(found, balance)
    yield _before_and_after(found, balance)
    for p, plane in enumerate(balance.planes):
        yield _residual(balance, found.last, p, plane)
    for p, plane in enumerate(balance.planes):
        yield _sheet(found, balance, p, plane)
    for side, (probe, _) in found.recorded.machine.planes.items():
        yield _vectors(found, balance, side, probe)


def _weights(found: Result, balance: Balanced) -> Sheet:
    """What was fixed, in order."""
    on = {w.number for w in found.recorded.on}
    rows = tuple(
        (purpose, balance.planes[w.plane].name, f"{1e3 * w.kg:.3f}", f"{np.degrees(w.angle) % 360:.1f}",
         f"{abs(_on_scale(w, balance)) / G_MM:.2f}", "on the shaft" if w.number in on else "taken off")
        for w, purpose in found.recorded.fixed
    )  # fmt: skip
    head = ("Weight", "Plane", "mass (g)", "angle (°)", "unbalance (g mm)", "now")
    radii = " and ".join(dict.fromkeys(f"{1e3 * plane.radius.value:.1f}" for plane in balance.planes))
    way = (
        ", as the planes' own scales read." if _scaled(balance) else ": from y towards z, in the direction of rotation."
    )
    return Sheet("weights", "Weights", f"At a radius of {radii} mm, on the scales of the planes{way}", head, rows,
                 (2, 3, 4))  # fmt: skip


def _scaled(balance: Balanced) -> bool:
    """Whether the rig file tells where the scales begin."""
    return any(plane.scaled for plane in balance.planes)


def _on_scale(w: Weight, balance: Balanced) -> complex:
    return w.unbalance(balance.planes[w.plane].radius.value)


def _before_and_after(found: Result, balance: Balanced) -> Sheet:
    """Unbalance as found and as left, against the permissible one."""
    rows = []
    for p, plane in enumerate(balance.planes):
        side = plane.name
        before, after = (abs(complex(balance.unbalance[name].values[p])) / G_MM for name in (BASE, found.last))
        per = balance.permissible[p].value / G_MM
        rows.append((side, f"{before:.2f}", f"{after:.2f}", f"{per:.2f}", f"{100 * after / per:.0f} %"))
    head = ("Plane", "as found (g mm)", "as left (g mm)", "permissible (g mm)", "as left / permissible")
    return Sheet("before-after", "Unbalance before and after", "Their intervals stand in the results.", head, tuple(rows),
                 (1, 2, 3, 4))  # fmt: skip


def _vectors(found: Result, balance: Balanced, side: str, probe: int) -> Figure:
    """A probe's vectors at the highest speed, one arrow a run, and the reading that would be left of runout alone."""
    runs = found.recorded.runs
    speed, axes = runs[0].fastest.speed * RPM, found.recorded.machine.axes
    tips = [(r.name, complex(r.fastest.vectors.values[probe])) for r in runs]
    alone = complex(balance.solved.influence[-1, probe] @ balance.solved.taken[-1])
    tips.append(("no unbalance, runout alone", alone))
    series = [
        Series(f"{name}, {UM * abs(z):.2f} µm ∠{lag_deg(z):.0f}°", np.array([-np.angle(z)] * 2), np.array([0.0, UM * abs(z)]),
               "both")
        for name, z in tips
    ]  # fmt: skip
    return Figure(
        f"vectors-{side}", f"Vectors of order 1 at probe {axes[probe]}, {speed:.0f} r/min, by run",
        f"As read, zero to peak, runout included; the angle is the phase lag from the once-per-turn mark, against "
        f"the rotation. "
        f"A balanced shaft would read what the runout alone leaves. Probe {axes[probe + 1]} shows the same a quarter turn "
        "later.",
        "phase lag", "µm 0-pk", tuple(series), "vectors",
    )  # fmt: skip


def _residual(balance: Balanced, last: str, p: int, plane: Plane) -> Figure:
    """What each verified run left, with its 95 % ellipse, in the circle of U_per."""
    per, side = balance.permissible[p].value / G_MM, plane.name
    on = "as it reads" if plane.scaled else "from y towards z, in the direction of rotation"
    names = [name for name in balance.unbalance if name.startswith("check")] or [last]
    series = [Series("U_per", per * np.cos(TURN), per * np.sin(TURN), "guide")]
    notes: list[tuple[str, float, float]] = []
    for name in names:
        one = balance.unbalance[name].one(p)
        outline, z = region(one, 121) / G_MM, complex(one.values[0]) / G_MM
        series.append(Series(f"{name}, 95 %", outline.real, outline.imag))
        series.append(Series(name, np.array([z.real]), np.array([z.imag]), "mark"))
        notes.append((f"{name}: {abs(z):.2f} g mm", z.real, z.imag))
    return Figure(
        f"residual-{side}", f"Residual unbalance {side} against the permissible one",
        f"On the scale of the {side} plane: to the right along its zero, upwards a quarter turn on ({on}). It is "
        f"reached where the whole ellipse lies within the circle of U_per = {per:.2f} g mm.",
        "along the scale's zero (g mm)", "a quarter turn on (g mm)", tuple(series), "plane", notes=tuple(notes),
    )  # fmt: skip


def _sheet(found: Result, balance: Balanced, p: int, plane: Plane) -> Figure:
    """Unbalance as found and the weights that were fixed, as vectors: on the scale, or, where the rig file tells how that lies
    on the shaft, as who looks at the shaft sees it."""
    points = [("unbalance as found", complex(balance.unbalance[BASE].values[p]))]
    points += [(purpose, _on_scale(w, balance)) for w, purpose in found.recorded.fixed if w.plane == p]
    points = [(name, z / G_MM) for name, z in points]
    series = [
        _arrow(f"{name}, {abs(z):.2f} g mm ∠{np.degrees(np.angle(z)) % 360:.0f}°", _seen(plane, z))
        for name, z in points
    ]
    top = 1.4 * max(abs(z) for _, z in points)
    series.append(Series("scale", top * np.cos(TURN), top * np.sin(TURN), "guide"))
    ticks = [(k, top * _seen(plane, np.exp(1j * np.radians(k)))) for k in range(0, 360, 90)]
    notes = [(f"{k}°", z.real, z.imag) for k, z in ticks]
    if plane.scaled:
        series.append(Series("once-per-turn mark", np.array([top]), np.array([0.0]), "mark"))
    right = "towards the mark" if plane.scaled else "along the scale's zero"
    return Figure(
        f"sheet-{plane.name}", f"Unbalance and weights {plane.name}",
        f"{_looked_at(found, plane)} Weights are added, at the radius of the plane. A trial weight is on "
        "the shaft in its own run alone, unless the plan leaves it.",
        f"{right} (g mm)", "a quarter turn on (g mm)", tuple(series), "plane", notes=tuple(notes),
    )  # fmt: skip


def _arrow(label: str, tip: complex) -> Series:
    return Series(label, np.array([0.0, tip.real]), np.array([0.0, tip.imag]), "both")


def _seen(plane: Plane, on_scale: complex) -> complex:
    """From the mark, in the direction of rotation, where the rig file tells how the scale lies on the shaft."""
    return plane.turned(on_scale) if plane.scaled else on_scale


def _looked_at(found: Result, plane: Plane) -> str:
    if not plane.scaled:
        return (
            f"On the scale of the {plane.name} plane: its 0° faces y while the shaft stands with its zero there; angles grow "
            "from y to z, in the direction of rotation."
        )
    shaft = found.rig.shaft
    end = shaft.far_end if shaft is not None else "far"
    return (
        f"Seen from outside the {end} end, from where the shaft turns counter-clockwise, with its mark to the right; numbers "
        f"are those of the {plane.name} plane's own scale. From the other end it is seen mirrored."
    )
