"""Harmonics of cogging as currents and as force or torque, and what sweeps of either way differ by, with influences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.cogging_map import fit
from procedures.cogging_map.fit import Array, Complex, Shape, Swept
from procedures.cogging_map.plan import Plan
from procedures.cogging_map.steps import Pass
from procedures.cogging_map.sweeps import Way
from procedures.position_loops.injection import ability
from procedures.position_loops.motors import around, cosine, electrical_turn, inertia, motors, off
from procedures.shared.certificates import certified, certified_gain

Found = dict[tuple[str, str], Estimate]


@dataclass(frozen=True)
class Known:
    """Of a loop's motors, by name: `constants` per true ampere, and the `read` true amperes that give force per ampere that is
    read; what they move."""

    constants: Mapping[str, Estimate]
    read: Mapping[str, Estimate]
    moved: Estimate

    @property
    def together(self) -> Estimate:
        """Force per ampere that each of them reads."""
        return sum((k * self.read[name] for name, k in self.constants.items()), Estimate.exact(0.0))


@dataclass(frozen=True)
class Result:
    """Of a loop: its sweeps, what each shows, the mean `shape` of the current, its standard uncertainty `u` A of either part
    of a harmonic with its degrees of freedom, the third harmonic, by how much the first one differs without the controller's
    feedforward (None: not looked at), how late positions are, rad of the phase of cogging; quantities by name and place."""

    map: Way
    passes: list[Pass]
    swept: list[Swept]
    shape: Shape
    u: float
    dof: int
    third: complex
    unfed: complex | None
    lag: float
    known: Known
    estimates: Found


def results(passes: Sequence[Pass], rig: RigFile, plan: Plan, facts: Mapping[str, Estimate]) -> list[Result]:
    """Each loop's; `facts`: constants and zeros that were measured, by `quantity@motor`.

    Raises:
        AnalysisError: sweeps that show no harmonics.
    """
    maps = dict.fromkeys(p.map for p in passes)
    return [_result([p for p in passes if p.map == one], rig, plan, facts) for one in maps]


def known(rig: RigFile, plan: Plan, loop: str, facts: Mapping[str, Estimate]) -> Known:
    """Of a loop's motors."""
    constants, read, turns = {}, {}, around(rig, loop)
    for name, one in motors(rig, loop).items():
        if plan.constants == "calibration":
            constants[name] = facts[f"{'K_torque' if turns else 'K_force'}@{name}"]
        else:
            assert one.constant is not None
            place = f"capabilities/force_currents/{name}/constant"
            constants[name] = certified(place, one.constant, f"constant of {name}")
        coils = rig.motors[name].currents
        gain = sum((certified_gain(rig, c) for c in coils), Estimate.exact(0.0, "1")) * (1 / len(coils))
        lost = cosine(rig, name, off(rig, plan.parameters, name, facts if plan.zeros == "calibration" else None))
        read[name] = 1 / (gain * lost)
    return Known(constants, read, inertia(rig, loop))


def _result(passes: list[Pass], rig: RigFile, plan: Plan, facts: Mapping[str, Estimate]) -> Result:
    of, about = passes[0].map, known(rig, plan, passes[0].map.loop, facts)
    swept = [_swept(p) for p in passes]
    mass = about.moved.value / about.together.value
    parts = np.array([s.corrected(mass) for s in swept])
    groups = _groups(passes)
    means = np.mean([parts[g].mean(axis=0) for g in groups], axis=0)
    u, dof = _scatter(parts[:, : len(of.signals)], groups)
    shape = fit.shape(complex(means[0]), complex(means[1]), of.per)
    first = {(p.sign, p.fed): complex(parts[g, 0].mean()) for g in groups for p in [passes[g[0]]]}
    lag = float(np.angle(_mean(first, 0, 1) / _mean(first, 0, -1))) / 2
    unfed = _mean(first, 1, False) - _mean(first, 1, True) if len({p.fed for p in passes}) == 2 else None
    taken = np.mean([-mass * s.rising for s in swept], axis=0)
    made = _Made(of, about, shape, u, dof, taken, swept, lag, passes[0].mean_s, rig)
    friction = _friction(of.loop, np.array([s.constant for s in swept]), passes, groups)
    return Result(of, passes, swept, shape, u, dof, complex(means[2]), unfed, lag, about, _estimates(made, friction))


def _groups(passes: Sequence[Pass]) -> list[list[int]]:
    """Sweeps of one way and feedforward."""
    kinds = dict.fromkeys((p.sign, p.fed) for p in passes)
    return [[k for k, p in enumerate(passes) if (p.sign, p.fed) == kind] for kind in kinds]


def _mean(of: Mapping[tuple[int, bool], complex], which: int, told: int) -> complex:
    """Of all kinds that have this way, or this feedforward."""
    return complex(np.mean([x for kind, x in of.items() if kind[which] == told]))


def _scatter(parts: Complex, groups: Sequence[Sequence[int]]) -> tuple[float, int]:
    """Standard uncertainty of either part of a mean by the sweeps of one kind about theirs, all harmonics (n, p) together;
    degrees of freedom."""
    left = np.concatenate([(parts[g] - parts[g].mean(axis=0)).ravel() for g in groups])
    dof = 2 * parts.shape[1] * sum(len(g) - 1 for g in groups)
    return math.sqrt(float(np.sum(np.abs(left) ** 2)) / dof / len(parts)), dof


def _swept(p: Pass) -> Swept:
    """By the mean of the motors' currents, which follow one reference."""
    current = np.mean(list(p.currents.values()), axis=0)
    return fit.swept(map_phase(p.map, p.position), p.times, p.position, current, p.map.orders, p.map.first)


def map_phase(of: Way, position: Array) -> Array:
    """Phase of the map, rad, where the position reads so much."""
    return np.asarray(2 * np.pi / of.length * position)


def _friction(loop: str, constants: Array, passes: Sequence[Pass], groups: Sequence[Sequence[int]]) -> Estimate:
    """Half of what the mean current up has over that down, A as it is read."""
    signs, dof = np.array([p.sign for p in passes]), sum(len(g) - 1 for g in groups)
    value = float(constants[signs > 0].mean() - constants[signs < 0].mean()) / 2
    left = sum(float(((constants[g] - constants[g].mean()) ** 2).sum()) for g in map(np.array, groups))
    u = math.sqrt(left / dof / len(passes))
    return Estimate.of(value, Influence(f"scatter/{loop}/friction", "scatter of the sweeps' means", u, "A", "A", "normal", dof,
                                        source="sweeps of one kind"))  # fmt: skip


@dataclass(frozen=True)
class _Made:
    map: Way
    known: Known
    shape: Shape
    u: float
    dof: int
    taken: Complex
    swept: Sequence[Swept]
    lag: float
    mean_s: float
    rig: RigFile

    def scatter(self, what: str, u: float, unit: str) -> Influence:
        return Influence(f"scatter/{self.map.loop}/{what}", f"scatter of the sweeps, {what}", u, unit, "A", "normal", self.dof,
                         source="sweeps of one kind")  # fmt: skip


def _estimates(m: _Made, friction: Estimate) -> Found:
    """Of the currents that are read what is true, and with the constants what they give."""
    loop, turns = m.map.loop, around(m.rig, m.map.loop)
    size, sine, cosine_share, phase = _shape(m)
    p, q, r = m.shape.peak
    peak = size * (sine * q + cosine_share * r + p)
    names = list(m.known.read)
    true = sum((m.known.read[n] for n in names), Estimate.exact(0.0, "1")) * (1 / len(names))
    force = m.known.together
    kind = "torque" if turns else "force"
    return {
        ("cogging_current", loop): size * true,
        ("peak_current", loop): peak * true,
        ("friction_current", loop): friction * true,
        ("cogging_phase", loop): phase,
        ("second_share", f"{loop}, sine"): sine,
        ("second_share", f"{loop}, cosine"): cosine_share,
        (f"cogging_{kind}", loop): size * force,
        (f"peak_{kind}", loop): peak * force,
        (f"friction_{kind}", loop): friction * force,
    }


def _shape(m: _Made) -> tuple[Estimate, Estimate, Estimate, Estimate]:
    """Amplitude A as it is read, sine and cosine shares, phase of the current in which cogging turns."""
    s, loop = m.shape, m.map.loop
    mass = _mass(m)
    first, second = _projected(m)
    rough = Influence(f"sweep/{loop}", "sweep: delay, period of the telemetry", s.amplitude
                      * _rough(m) / math.sqrt(3), "A", "B", "rectangular", source="bound by speed and rate")  # fmt: skip
    size = Estimate.of(s.amplitude, m.scatter("first harmonic", m.u, "A")) + mass * first + Estimate.of(0.0, rough)
    turned = Estimate.of(0.0, m.scatter("phase", m.u / s.amplitude, "rad"))  # of cogging
    spread = _spread(m)
    sine = Estimate.of(s.sine, m.scatter("second harmonic, sine", m.u / s.amplitude, "1"))
    cosine_share = Estimate.of(s.cosine, m.scatter("second harmonic, cosine", m.u / s.amplitude, "1"))
    share = Estimate.of(0.0, m.scatter("first harmonic", m.u, "A")) * (1 / s.amplitude)
    sine = sine - share * s.sine - turned * (2 * s.cosine) + mass * second.imag + spread[0]
    cosine_share = cosine_share - share * s.cosine + turned * (2 * s.sine) + mass * second.real + spread[1]
    phase = turned * (1 / s.per) + _phase(m)
    return size, _plain(sine), _plain(cosine_share), Estimate(phase.value, "rad", phase.sensitivities)


def _plain(share: Estimate) -> Estimate:
    return Estimate(share.value, "1", share.sensitivities)


def _mass(m: _Made) -> Estimate:
    """By which share mass over constant may be off."""
    ratio = m.known.moved / m.known.together
    relative = ratio * (1 / ratio.value)
    return Estimate(0.0, "1", relative.sensitivities)


def _projected(m: _Made) -> tuple[float, complex]:
    """What the swinging mass takes of the amplitude, A, and of the second harmonic's shares (cosine; -sine as imaginary part,
    turned to its sign)."""
    s = m.shape
    turn = complex(math.cos(s.per * s.phase), math.sin(s.per * s.phase))
    first = complex(m.taken[0]) * turn * 1j  # along F_1
    second = complex(m.taken[1]) * turn**2 / s.amplitude
    return first.real, complex(second.real, -second.imag)


def _rough(m: _Made) -> float:
    """Half width, as a share: both ways' lag; means over the telemetry's period, where its samples are any."""
    mean = (math.pi * m.mean_s / m.map.period_s(1)) ** 2 / 6
    return float(1 - math.cos(m.lag) + mean)


def _spread(m: _Made) -> tuple[Estimate, Estimate]:
    """Gains that differ from coil to coil make of the first harmonic one of thrice and one of once its phase less that of the
    field: i_q (1 + g cos 2p), g of either part 1/n sqrt(n/2) of a gain's uncertainty. Where cogging turns twice with the phase
    half of g is a second harmonic."""
    if m.map.per != 2:
        return Estimate.exact(0.0, "1"), Estimate.exact(0.0, "1")
    coils = [c for name in m.known.read for c in m.rig.motors[name].currents]
    u = math.sqrt(sum(m.rig.sensors[c].gain.standard_uncertainty ** 2 for c in coils) / 2) / len(coils) / 2
    made = (
        Influence(f"spread/{m.map.loop}/{part}", "gains of the coils' sensors against each other", u, "1", "B", "normal",
                  source="certificates of the current sensors")
        for part in ("sine", "cosine")
    )  # fmt: skip
    first, other = (Estimate.of(0.0, x) for x in made)
    return first, other


def _phase(m: _Made) -> Estimate:
    """By true places: what the position's gain and the turn of the phase move in the middle of the map."""
    motor = next(iter(m.known.read))
    channel, middle = ability(m.rig).loops[m.map.loop].channel, m.map.low + m.map.length / 2
    turn = electrical_turn(m.rig, motor)
    there = 2 * math.pi * middle / turn
    if channel in m.rig.sensors:
        sensor = m.rig.sensors[channel]
        there = (middle - certified(f"sensors/{channel}/offset", sensor.offset, f"offset of {channel}")) * (
            2 * math.pi / (turn * certified_gain(m.rig, channel))
        )
    nominal = 2 * math.pi * middle / turn.value
    return there - nominal + m.shape.phase


def slope(r: Result, place: float) -> Estimate:
    """Of what takes cogging off, where the position reads so much: N/m or N m/rad. Harmonics alone, by their own scatter."""
    s, b = r.shape, r.shape.per * (r.map.turns * 2 * math.pi / r.map.length * place - r.shape.phase)
    per = r.map.first * 2 * math.pi / r.map.length
    value = math.cos(b) + 2 * s.sine * math.cos(2 * b) - 2 * s.cosine * math.sin(2 * b)
    bend = -math.sin(b) - 4 * s.sine * math.sin(2 * b) - 4 * s.cosine * math.cos(2 * b)
    u = r.u / s.amplitude * math.hypot(value, bend, 2)
    noise = Influence(f"scatter/{r.map.loop}/slope", "scatter of the sweeps", u, "1", "A", "normal", r.dof)
    return Estimate.of(value, noise) * (s.amplitude * per) * r.known.together
