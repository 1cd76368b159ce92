"""Figures of rotating machines in the field's habit: um with 0-pk or pk-pk stated, r/min, phase lag in degrees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench.analysis.orbits import Ellipse
from bench.analysis.ordermap import OrderMap
from bench.analysis.sampling import Array, Complex
from bench.analysis.spectra import FullSpectrum, Waterfall
from bench.figures import Figure, Grid, Series

UM, RPM = 1e6, 30 / math.pi
HIGH = 0.16  # of the axis: the tallest line of a waterfall
SMALL = 0.4  # of the clearance: the reach of an orbit that is shown closer too
GAP_DEG = 22.0  # of a turn left blank before the mark: the motion runs from the blank into the dot
TURN = np.linspace(0, 2 * math.pi, 181)


@dataclass(frozen=True)
class Orbit:
    """What one orbit plot shows: raw samples `x`, `y` (n,) m (a few turns), or the synchronous `ellipse` about `centre` m."""

    label: str
    x: Array | None = None
    y: Array | None = None
    ellipse: Ellipse | None = None
    centre: tuple[float, float] = (0.0, 0.0)
    once: str = ""  # what the synchronous one is called, if not by the label


@dataclass(frozen=True)
class Outlook:
    """How orbits are looked at: `x_probe_deg` is where probe x stands, counterclockwise from the right; `seen` is from where,
    and which way the shaft turns; `right` and `above` are what lies there of a shaft that lies."""

    x_probe_deg: float = 0.0
    seen: str = "Seen along the shaft"
    right: str = "horizontal"
    above: str = "vertical"


DOWN_THE_SHAFT = Outlook()


@dataclass(frozen=True)
class Curve:
    """Vectors `values` (b,) m 0-pk at `speed` (b,) rad/s; `u` (b,) m, expanded, where bars are wanted."""

    label: str
    speed: Array
    values: Complex
    u: Array | None = None


def orbits(key: str, title: str, shown: Sequence[Orbit], clearance: float, outlook: Outlook = DOWN_THE_SHAFT) -> Figure:
    """Orbits within the clearance circle. The synchronous orbit is blank before its keyphasor dot."""
    x_probe_deg = outlook.x_probe_deg
    what, closer = "", _closer(shown, clearance, x_probe_deg)
    if closer is not None:
        what = " Beside it the same, closer."
    series = [Series("clearance", UM * clearance * np.cos(TURN), UM * clearance * np.sin(TURN), "guide")]
    for o in shown:
        if o.x is not None and o.y is not None:
            series.append(_turned(o.label, o.x, o.y, x_probe_deg, "faint"))
        if o.ellipse is not None:
            x, y = o.ellipse.path(361)
            seen = slice(0, round(361 - GAP_DEG))
            series.append(
                _turned(o.once or f"{o.label} 1x", x[seen] + o.centre[0], y[seen] + o.centre[1], x_probe_deg, "line")
            )
            at = o.ellipse.mark + complex(*o.centre)
            series.append(_turned("mark", np.array([at.real]), np.array([at.imag]), x_probe_deg, "mark"))
    reach = UM * clearance
    notes = tuple(
        (name, 1.06 * reach * math.cos(angle), 1.06 * reach * math.sin(angle))
        for name, angle in (("X", math.radians(x_probe_deg)), ("Y", math.radians(x_probe_deg + 90)))
    )
    return Figure(
        key,
        title,
        f"{outlook.seen}; X and Y are where the probes stand. The dot is where the shaft's centre is as the "
        f"once-per-turn mark passes; the blank comes just before it.{what}",
        f"{outlook.right} (µm)",
        f"{outlook.above} (µm)",
        tuple(series),
        "plane",
        notes=notes,
        closer=closer,
    )


def _closer(shown: Sequence[Orbit], clearance: float, degrees: float) -> tuple[float, float, float] | None:
    """Where orbits lie that are too small to be seen within the clearance: their middle, and how far they reach, µm."""
    paths = [o.ellipse.path(361) + np.array(o.centre)[:, None] for o in shown if o.ellipse is not None]
    paths += [np.array([o.x, o.y]) for o in shown if o.x is not None and o.y is not None]
    if not paths:
        return None
    z = UM * np.concatenate([p[0] + 1j * p[1] for p in paths]) * np.exp(1j * math.radians(degrees))
    middle = complex(np.ptp(z.real) / 2 + z.real.min(), np.ptp(z.imag) / 2 + z.imag.min())
    reach = max(float(np.ptp(z.real)), float(np.ptp(z.imag))) / 2
    return (middle.real, middle.imag, 1.25 * reach) if 0 < reach < SMALL * UM * clearance else None


def _turned(label: str, x: Array, y: Array, degrees: float, style: str) -> Series:
    z = UM * (x + 1j * y) * np.exp(1j * math.radians(degrees))
    return Series(label, z.real, z.imag, style)  # type: ignore[arg-type]


def bode(key: str, title: str, curves: Sequence[Curve], order: float = 1.0, caption: str = "") -> Figure:
    """Amplitude over unwrapped phase lag against speed; lags grow downwards, as they do on such plots."""
    ordered = [_sorted(c) for c in curves]
    lower = Figure(
        key,
        "",
        "",
        "speed (r/min)",
        "phase lag (°)",
        tuple(Series(c.label, RPM * c.speed, _unwrapped(c.values), _style(c)) for c in ordered),
        downward=True,
    )
    return Figure(
        key,
        title,
        caption
        or f"Vectors of order {order:g}: amplitude zero to peak; phase lag from the once-per-turn mark to the high spot.",
        "speed (r/min)",
        f"{order:g}x amplitude (µm 0-pk)",
        tuple(
            Series(c.label, RPM * c.speed, UM * np.abs(c.values), _style(c), None if c.u is None else UM * c.u)
            for c in ordered
        ),
        below=lower,
    )


def _style(curve: Curve) -> Literal["line", "both"]:
    """Vectors with intervals were measured at these speeds alone; others come so close that they make a curve."""
    return "line" if curve.u is None else "both"


def _sorted(curve: Curve) -> Curve:
    k = np.argsort(curve.speed)
    return Curve(curve.label, curve.speed[k], curve.values[k], None if curve.u is None else curve.u[k])


def _unwrapped(values: Complex) -> Array:
    """Lag in degrees, continuous, the first in [0, 360) unless that is next to a whole turn."""
    lag = np.degrees(np.unwrap(-np.angle(values)))
    return np.asarray(lag - 360 * np.floor((np.median(lag[:5]) + 30) / 360))


def polar(key: str, title: str, curves: Sequence[Curve], every_rpm: float = 1000.0, order: float = 1.0) -> Figure:
    """Vectors as points of a curve with the speeds written along it; of vectors with intervals those that were measured."""
    series: list[Series] = []
    notes: list[tuple[str, float, float]] = []
    told: list[complex] = []
    for c in (_sorted(c) for c in curves):
        series.append(Series(c.label, -np.angle(c.values), UM * np.abs(c.values)))
        rpm = RPM * c.speed
        steps = (
            rpm
            if c.u is not None
            else np.arange(math.ceil(rpm[0] / every_rpm), math.floor(rpm[-1] / every_rpm) + 1) * every_rpm
        )
        there = np.interp(steps, rpm, c.values.real) + 1j * np.interp(steps, rpm, c.values.imag)
        lag, size = -np.angle(there), UM * np.abs(there)
        series.append(Series("speed in r/min", lag, size, "mark"))
        seen = _apart(there, told, max(float(np.abs(each.values).max()) for each in curves))
        notes += [(f"{steps[k]:.0f}", float(lag[k]), float(size[k])) for k in seen]
    return Figure(
        key,
        title,
        f"Vectors of order {order:g}. The angle is the phase lag, against the rotation; numbers are speeds in r/min.",
        "phase lag",
        "µm 0-pk",
        tuple(series),
        "vectors",
        notes=tuple(notes),
    )


def _apart(values: Complex, told: list[complex], greatest: float) -> list[int]:
    """Of some points those whose labels, to the right of them, lie over none of those `told` before; they are told then."""
    chosen: list[int] = []
    for k, z in enumerate(values):
        if all(abs(z - other) > 0.12 * greatest and not _over(z - other, greatest) for other in told):
            chosen.append(k)
            told.append(complex(z))
    return chosen


def _over(apart: complex, greatest: float) -> bool:
    """Whether labels of points so far apart meet: lag zero is up, so that the real part is height."""
    return abs(apart.real) < 0.1 * greatest and abs(apart.imag) < 0.3 * greatest


def waterfall(
    key: str, title: str, found: Waterfall, highest_hz: float, orders: Sequence[float] = (1.0, 2.0)
) -> Figure:
    """Spectra one behind the other at their speeds; the dashed lines are the orders."""
    hz, values = _thinned(found.hz, found.values, highest_hz)
    rpm = RPM * found.speed
    tall = UM * float(values.max()) or 1.0
    scale = HIGH * (float(np.ptp(rpm)) or float(rpm.max())) / tall
    back_to_front = np.argsort(-rpm, kind="stable")
    series = [Series("spectra", hz, rpm[k] + scale * UM * values[k], "ridge") for k in back_to_front]
    notes = []
    ends = np.array([rpm.min(), rpm.max()])
    for n in orders:
        at = ends[n * ends / 60 <= highest_hz]
        top = min(float(rpm.max()), highest_hz * 60 / n)
        if at.size:
            series.append(Series(f"{n:g}x", n * np.array([at[0], top]) / 60, np.array([at[0], top]), "guide"))
            notes.append((f"{n:g}x", n * top / 60, top))
    return Figure(
        key,
        title,
        f"Amplitude spectra ({found.scaling}, window {found.window}) at their speeds. The tallest line is {tall:.3g} µm; "
        f"1 µm is as high as {scale:.3g} r/min of the axis.",
        "frequency (Hz)",
        "speed (r/min)",
        tuple(series),
        notes=tuple(notes),
    )


def _thinned(hz: Array, values: Array, highest: float, points: int = 240) -> tuple[Array, Array]:
    """Lines up to `highest` Hz, the greatest of neighbours where they are more than can be told apart in print."""
    seen = int(np.searchsorted(hz, highest, side="right"))
    each = -(-seen // points)
    starts = np.arange(0, seen, each)
    return hz[starts + np.minimum(each, seen - starts) // 2], np.maximum.reduceat(values[:, :seen], starts, axis=1)


def order_map(key: str, title: str, found: OrderMap) -> Figure:
    """Amplitudes in colours over order and speed."""
    k = np.argsort(found.speed, kind="stable")
    grid = Grid(found.orders, RPM * found.speed[k], UM * found.values[k], "µm 0-pk", decades=3)
    return Figure(
        key,
        title,
        f"Order spectra of the record resampled to equal angles, window {found.window}; blank where the sampling rate ends.",
        "order of the speed",
        "speed (r/min)",
        (),
        grid=grid,
    )


def full_spectrum(key: str, title: str, found: FullSpectrum, speed: float, highest_hz: float) -> Figure:
    """Backward motion to the left, forward to the right, the synchronous lines named."""
    seen = np.abs(found.hz) <= highest_hz
    hz, size = found.hz[seen], UM * found.values[seen]
    once = speed / (2 * math.pi)
    peaks = [
        (f"{n:+d}x", n * once, float(size[np.abs(hz - n * once) <= 2 * (hz[1] - hz[0])].max(initial=0.0)))
        for n in (-2, -1, 1, 2)
        if abs(n) * once < highest_hz
    ]
    return Figure(
        key,
        title,
        f"Full spectrum of the orbit at {RPM * speed:.0f} r/min, window {found.window}: radius of the circular motions, "
        "forward with the rotation, backward against it.",
        "backward  ←  frequency (Hz)  →  forward",
        f"amplitude (µm {found.scaling})",
        (Series("orbit", hz, size),),
        notes=tuple(peaks),
    )
