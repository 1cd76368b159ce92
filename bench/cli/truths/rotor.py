"""Truths of procedures of a shaft in two radial AMBs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from bench.cli.truths.settings import Found, settings_of
from bench.findings import Finding

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated
    from procedures.amb_rotor.machine import AmbRotor
    from sim_backend.motion import Whirl

MARGIN_POINTS = 20000


def step(done: Simulated) -> Found:
    from procedures.amb_rotor.conventions import conventions
    from procedures.step.named import list_settings
    from procedures.step.procedure import model, recorded_s, waited_s
    from procedures.step.steps import AT_REST_S, Case
    from sim_backend.motion import StepsAsked

    plan: Any = done.recording.plan
    rig, steps = done.recording.rig, done.drawn.machine.motions.steps
    if steps is None:
        return
    other_band = {r.where for r in done.results if isinstance(r, Finding) and r.code == "band-widened"}
    for setting, changed in list_settings(plan, rig).items():
        settings = settings_of(done, model(rig, plan), changed)
        for speed in plan.speeds_rad_s:
            window = 2 * math.pi / speed if speed else AT_REST_S
            for axis in plan.axes:
                asked = StepsAsked(
                    settings, axis, partial(conventions(rig).point, axis), plan.sizes_m, speed, plan.rest_s,
                    record_s=recorded_s(rig, plan), wait_s=waited_s(rig, plan, setting, axis),
                )  # fmt: skip
                small, shown = steps(rig, done.drawn, asked)
                cases = {key: Case(setting, speed, axis, *key) for key in shown}
                group = next(iter(cases.values())).group
                if math.isfinite(small.frequency):
                    yield "damping", group, small.damping
                    yield "natural_frequency", group, small.frequency
                for key, of in shown.items():
                    for name in ("overshoot", "rise_time", "steady_error", "bandwidth"):
                        yield name, cases[key].where, getattr(of, name)
                    if cases[key].where not in other_band:
                        yield "settling_time", cases[key].where, of.settling_time(plan.band, window)


def tracking(done: Simulated) -> Found:
    from procedures.tracking.by_points import sizes
    from procedures.tracking.procedure import placed
    from procedures.tracking.steps import read_orbits
    from sim_backend.motion import OrbitAsked

    plan: Any = done.recording.plan
    rig, of = done.recording.rig, done.drawn.machine.motions.orbit
    half_y, half_z = sizes(rig, plan)
    for orbit in read_orbits(done.recording):
        if orbit.law in plan.judged and of is not None:
            settings, machine = settings_of(done, orbit.machine.select(orbit.law)), orbit.machine
            asked = OrbitAsked(settings, plan.hz, half_y, half_z, plan.ratio, plan.speed_rad_s, plan.settle_s)
            if orbit.path.points is not None:
                at = partial(_at, machine)
                asked = replace(asked, hz=plan.points_hz, points=plan.points, at=at)
            found = of(rig, done.drawn, asked)
            yield from ((quantity.name, where, found[name]) for name, quantity, where in placed(orbit, found))


def _at(machine: AmbRotor, y: float, z: float) -> Mapping[str, float]:
    return machine.points({"y": y, "z": z})


def _vectors(axes: Iterable[str], shaft: Iterable[complex], where: str) -> Found:
    for axis, vector in zip(axes, shaft, strict=True):
        yield "vector_cos", f"{axis}, {where}", float(vector.real)
        yield "vector_sin", f"{axis}, {where}", float(-vector.imag)


def _distances(planes: Iterable[str], whirl: Whirl, where: str) -> Found:
    for plane, far, clearance in zip(planes, whirl.d_max, whirl.clearance, strict=True):
        yield "d_max", f"{plane}, {where}", far
        yield "d_max_share", f"{plane}, {where}", far / clearance


def unbalance(done: Simulated) -> Found:
    from procedures.synchronous.dwells import DWELL, read_dwells

    plan: Any = done.recording.plan
    of = done.drawn.machine.motions.whirl
    for dwell in read_dwells(done.recording):
        if dwell.kind != DWELL or dwell.again or of is None:
            continue
        machine = dwell.machine
        law = {**(machine.poles if plan.observed else {}), **machine.select(plan.law)}
        settings = settings_of(done, law, machine.variants[dwell.variant])
        true = of(done.recording.rig, done.drawn, settings, dwell.speed, machine.positions)
        yield from _vectors(machine.axes, true.shaft, dwell.where)
        yield from _distances(machine.planes, true, dwell.where)


def balance(done: Simulated) -> Found:
    from procedures.balance.planes import chosen, names_of

    of = done.drawn.machine.motions.left
    if of is None:
        return
    plan: Any = done.recording.plan
    names = names_of(chosen(done.recording.rig, plan.planes))
    own = of(done.recording.rig, done.drawn, done.recording.events("operator"), names)
    for name, values in (("unbalance", own[0]), ("residual", own[-1])):
        for side, value in zip(names, values, strict=True):
            yield f"{name}_cos", side, float(value.real)
            yield f"{name}_sin", side, float(value.imag)


def passage(done: Simulated) -> Found:
    """Vectors, orbits and D_max where the speed stands; what is critical at the speeds where the run found it."""
    import numpy as np

    from procedures.amb_rotor.conventions import conventions

    plan: Any = done.recording.plan
    run, of = done.procedure.evaluated(done.recording).result, done.drawn.machine.motions
    if run is None or run.near is None or of.whirl is None:
        return
    rig, machine = done.recording.rig, conventions(done.recording.rig)
    settings = settings_of(done, machine.variants["off"], plan.parameters, machine.select(plan.law))
    for result in run.near.dwells:
        true, where = of.whirl(rig, done.drawn, settings, result.dwell.speed, machine.positions), result.dwell.where
        yield from _vectors(machine.axes, true.shaft, where)
        yield from _distances(machine.planes, true, where)
        for plane, pair in machine.planes.items():
            looking = [machine.stations.probes[machine.positions[k]] for k in pair]
            a, b = np.linalg.solve([[p.sign * x for x in p.row[:2]] for p in looking], [true.shaft[k] for k in pair])
            yield "major_half_axis", f"{plane}, {where}", float(abs(a + 1j * b) + abs(a - 1j * b)) / 2
    peaks = [p for p in run.peaks if p.critical]
    if not peaks or of.passage is None:
        return
    ends = [x for p in run.peaks for x in (p.low, p.speed.value, p.high) if math.isfinite(x)]
    held = of.passage(rig, done.drawn, settings, 0.85 * min(ends), 1.1 * max(ends), machine.positions)
    for p in peaks:
        speed, amplitude, factor = held.critical(machine.axes.index(p.axis), p.speed.value)
        yield "critical_speed", p.where, speed
        yield "critical_amplitude", p.where, amplitude
        yield "amplification_factor", p.where, factor
        yield "separation", p.where, abs(speed - plan.running_rad_s) / plan.running_rad_s


def sensitivity(done: Simulated) -> Found:
    import numpy as np

    from bench.units import RPM
    from procedures.amb_rotor.conventions import conventions
    from procedures.sensitivity.fitting import chosen_axes
    from procedures.sensitivity.margins import fall, phase, rise

    plan: Any = done.recording.plan
    rig, machine, of = done.recording.rig, conventions(done.recording.rig), done.drawn.machine.motions
    settings = settings_of(done, machine.select(plan.law))
    for speed in plan.speeds_rad_s:
        if (of.peak if speed else of.loop) is None:
            continue
        loop = None if speed or of.loop is None else of.loop(rig, done.drawn, settings, machine.all_axes)
        for axis in chosen_axes(rig, plan):
            k, where = machine.all_axes.index(axis), f"{axis}, {f'{speed * RPM:.0f} r/min' if speed else 'at rest'}"
            if loop is not None:
                value, hz = loop.peak(k, plan.low_hz, plan.high_hz)
            else:
                assert of.peak is not None
                value, hz = of.peak(rig, done.drawn, settings, k, speed)
            yield "s_max", where, value
            yield "s_max_hz", where, hz
            if loop is not None:
                open_loop = 1 / loop.sensitivity(np.geomspace(plan.low_hz, plan.high_hz, MARGIN_POINTS))[:, k] - 1
                for name, margin in (("phase_margin", phase), ("gain_reduction", fall), ("gain_increase", rise)):
                    yield name, where, margin(open_loop)
