"""What a plane's coils need at most, as a quantity: the current and the voltage that are exceeded for 1 % of the time.

The largest of N noisy readings grows with N and is nobody's: of a quantile that is not so. Its scatter is that of the share of
the time spent above it, over whole turns, through the distribution's own slope (Bahadur, Ann. Math. Stat. 37, 577 (1966)):
u(q) = u(p) dq/dp.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.findings import Finding
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.amb_rotor.conventions import conventions
from procedures.shared.certificates import certified
from procedures.synchronous.dwells import Dwell, Full, can_capture

Array = npt.NDArray[np.float64]
SHARE = 0.01  # of the time
BLOCKS = 16  # of whole turns, at most
QUANTILE = 2.326  # of a normal: by so many of its standard deviations noise alone raises what is exceeded for SHARE


@dataclass(frozen=True)
class Exceeded:
    """Readings' absolute `value` that is exceeded for SHARE of the time, its scatter `u` with `dof`; `sign` of the readings
    that exceed it."""

    value: float
    u: float
    dof: float
    sign: float


def find_exceeded(x: Array, edges: npt.NDArray[np.intp]) -> Exceeded:
    """Of readings (n,), in blocks of whole turns between the indices `edges` (b + 1,), b at least 2."""
    inside = x[edges[0] : edges[-1]]
    size = np.abs(inside)
    value, above, below = (float(q) for q in np.quantile(size, [1 - SHARE, 1 - SHARE / 2, 1 - 1.5 * SHARE]))
    beyond = (size > value).astype(np.float64)
    shares = np.add.reduceat(beyond, edges[:-1] - edges[0]) / np.diff(edges)
    u = float(shares.std(ddof=1)) / math.sqrt(len(shares)) * (above - below) / SHARE
    sign = math.copysign(1.0, float(inside[size >= value].sum()))
    return Exceeded(value, u, float(len(shares) - 1), sign)


def blocks(full: Full) -> npt.NDArray[np.intp]:
    """Sample indices (b + 1,) between which a capture has whole turns, as many in each of up to BLOCKS blocks as there are."""
    times, turns = full.tacho.times, full.tacho.turns
    seen = turns[(times >= full.t[0]) & (times <= full.t[-1])]
    whole = np.round(np.linspace(seen[0], seen[-1], min(BLOCKS, int(seen[-1] - seen[0])) + 1))
    return np.searchsorted(full.t, full.tacho.time(2 * math.pi * whole))


def peaks(d: Dwell, inputs: Mapping[str, Estimate], plane: str, rig: RigFile) -> dict[tuple[str, str], Estimate]:
    """Current and voltage of the plane's coil that needs most, with gain, zero, resolution, and the scatter over the turns;
    nothing without a capture, and
    no voltage where none is captured."""
    if d.full is None:
        return {}
    first, edges = 2 * d.machine.planes[plane][0], blocks(d.full)
    of = range(first, first + 4)

    def greatest(readings: Array) -> tuple[int, Exceeded]:
        found = {k: find_exceeded(readings[k], edges) for k in of}
        k = max(of, key=lambda k: found[k].value)
        return k, found[k]

    k, seen = greatest(d.full.currents)
    where = f"{d.where}/{plane}"
    current = _scattered(seen, f"current/{where}", "A") + _noise(d.full.currents[k], where)
    current = (current + _resolution(rig, d.machine.currents[k], where) - inputs[f"i_zero_{k}"]) / inputs[f"i_gain_{k}"]
    peak = {("current_peak", plane): replace(current, unit="A")}
    if not d.full.voltages.size:  # the controller captures none
        return peak
    j, seen = greatest(d.full.voltages)
    name = d.machine.voltages[j]
    voltage = _scattered(seen, f"voltage/{where}", "V") + _resolution(rig, name, where)
    if (sensor := rig.sensors.get(name)) is not None:
        zero, gain = (
            certified(f"sensors/{name}/{what}", t, f"{what} of {name}")
            for what, t in (("offset", sensor.offset), ("gain", sensor.gain))
        )
        voltage = (voltage - seen.sign * zero) / gain
    return {**peak, ("voltage_peak", plane): replace(voltage, unit="V")}


def find_uncertified(rig: RigFile) -> Iterator[Finding]:
    """Whether the voltages are no more than what the amplifiers say, or not captured at all."""
    missing = [name for name in conventions(rig).voltages if name not in rig.sensors]
    if missing:
        text = (
            f"no certificates of {', '.join(missing)}: voltages are as the amplifiers read them, without gain and zero"
        )
        yield Finding("voltage-not-certified", text)
    if can_capture(rig) and not conventions(rig).voltages:
        text = ("captures have no coil voltages: what the coils need of the amplifiers' voltage is not stated. Bind "
                "`voltages` of each bearing's axes, and name these channels in [capture.channels], to have it.")  # fmt: skip
        yield Finding("voltage-not-captured", text)


def _scattered(seen: Exceeded, identity: str, unit: str) -> Estimate:
    name = f"scatter over {seen.dof + 1:.0f} blocks of turns"
    return Estimate.of(seen.value, Influence(f"scatter/{identity}", name, seen.u, unit, "A", "normal", seen.dof))


def _noise(readings: Array, where: str) -> Estimate:
    """What the sensor's own noise adds: nothing where the current moves by much more, all of its quantile where it stands."""
    noise = float(np.diff(readings, 3).std()) / math.sqrt(20)
    half = QUANTILE * noise / 2
    influence = Influence(f"noise/{where}", "noise of the readings", half / math.sqrt(3), "A", "B", "rectangular")
    return Estimate.of(-half, influence)


def _resolution(rig: RigFile, channel: str, where: str) -> Estimate:
    scale, unit = (
        (rig.capture.channels[channel].scale, rig.capture.channels[channel].unit) if rig.capture else (0.0, "")
    )
    step = Influence(f"resolution/{channel}/{where}", "resolution", scale / math.sqrt(12), unit, "B", "rectangular")
    return Estimate.of(0.0, step)
