"""What can be wrong with readings of load cells that hold the shaft, and with the map that they make."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.inductance_map.model import mapped
from procedures.shared import signals
from procedures.stages.stators import phases
from procedures.static_characteristics import fit
from procedures.static_characteristics.estimates import FIRST, Result
from procedures.static_characteristics.model import MAP, Array, Rows, Terms, q_of
from procedures.static_characteristics.plan import Plan
from procedures.static_characteristics.readings import held, less_zeros, rows
from procedures.static_characteristics.requires import cells
from procedures.static_characteristics.steps import Taken

READY = "READY"
FEWEST = 6  # places
APART = 4.0  # standard uncertainties of the difference
REACHED = 0.9  # of a current that was asked for
LEAST = 0.3  # of a correlation: readings that have it go with the currents
BETTER = 0.05  # by which another phase goes with the readings better
RATIO = 4.0  # standard uncertainties
TOLD = {"gain": "cell-gain-apart", "cross": "cells-cross", "give": "cell-gives-way", "arm": "cell-gain-apart",
        "current": "current-gain-apart", "offset": "current-offset-apart"}  # fmt: skip
CONCERNED = ("static_slope", "force", "torque", "force_ratio", "torque_ratio")


def of_signals(t: Taken, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Nothing read, another state, losses, currents that are not there."""
    there = np.isfinite(t.loads).all(axis=(1, 2, 3)) & np.isfinite(t.currents).all(axis=(1, 2, 3))
    if there.sum() < len(t.places) or len(t.places) < FEWEST:
        text = (f"found readings of {int(there.sum())} places; expected {max(FEWEST, len(t.places))} (was the run "
                "stopped early?)")  # fmt: skip
        yield Finding("readings-missing", text, "", Effect.ERROR)
        return
    if other := [s for s in t.states if rig.binding.mode(s) != READY]:
        text = f"the controller was in {', '.join(other)}: other phases may have carried current."
        yield Finding("not-let-go", text, "", Effect.ERROR)
        return
    yield from signals.losses_of((t,), plan.max_lost)
    levels, per = np.array(plan.levels_A), len(plan.levels_A)
    for k, phase in enumerate(t.phases):
        mine = t.currents[:, 1 + k * per : 1 + (k + 1) * per, :, k].mean(axis=(0, 2))
        if (mine < 0).any():
            yield Finding("sign-reversed", f"its current reads {mine.min():.3g} A.", phase.name, Effect.ERROR)
            return
        if (mine < REACHED * levels).any():
            worst = int(np.argmin(mine / levels))
            text = f"it carried {mine[worst]:.3g} A; {levels[worst]:g} A were asked for."
            yield Finding("current-not-reached", text, phase.name, Effect.INDETERMINATE, (f"static_gain@{phase.name}",))


def of_order(t: Taken, rig: RigFile) -> Iterator[Finding]:
    """Cells that read the other way round, phases that are exchanged: nothing could be fitted."""
    both = cells(rig)
    assert both is not None
    of, some = rows(t, rig, both), phases(rig)
    expected = [_expected(of, np.full(len(of.phase), k)) for k in range(len(some))]
    for axis, cell in enumerate(both):
        alike = _alike(
            np.array([e[axis] for e in expected])[of.phase, np.arange(len(of.phase))], (of.force, of.torque)[axis]
        )
        if alike < -LEAST:
            text = f"{cell.by.instrument} reads less where the phases should press more."
            yield Finding("cell-reversed", text, cell.axis.name, Effect.ERROR)
            return
        if alike < LEAST:
            text = (f"{cell.by.instrument} does not go with the currents, correlation {alike:.2f}: does it hold the "
                    f"shaft, and does it "
                    "show N?")  # fmt: skip
            yield Finding("cell-does-not-hold", text, cell.axis.name, Effect.ERROR)
            return
    for k, phase in enumerate(some):
        mine = of.phase == k
        goes = [min(_alike(e[0][mine], of.force[mine]), _alike(e[1][mine], of.torque[mine])) for e in expected]
        best = int(np.argmax(goes))
        if goes[best] > goes[k] + BETTER:
            text = (f"what it presses is what {some[best].name} should: phases are exchanged, or the encoder's zero is another "
                    "one.")  # fmt: skip
            yield Finding("phase-elsewhere", text, phase.name, Effect.ERROR)


def _expected(of: Rows, k: Array) -> tuple[Array, Array]:
    """Roughly what a phase presses at each load."""
    m = {**dict.fromkeys(MAP, 0.0), **FIRST}
    _, around, along = mapped(m, np.ones(len(of.side)), of, k.astype(np.intp), of.x[of.place], of.angle[of.place])
    q = q_of(of.current, m["saturation"])
    return along * q, around * q


def _alike(a: Array, b: Array) -> float:
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size else 0.0


def of_readings(t: Taken, plan: Plan) -> Iterator[Finding]:
    """Friction that hides the load, readings that stand far off, zeros that wander."""
    along, around = held(t)
    least = slice(1, None, len(plan.levels_A))
    loads = less_zeros(t).mean(axis=2)
    for name, values, axis in (("along", along, 0), ("around", around, 1)):
        most = float(np.abs(loads[:, 1:-1, axis][:, :: len(plan.levels_A)]).max())
        rubs = float(np.abs(values[:, least]).mean())
        if rubs > plan.max_held * most:
            text = (f"friction holds {rubs:.3g} of up to {most:.3g} that {plan.levels_A[0]:g} A press, in N or N m: "
                    f"what is left is a "
                    "difference of both sides. Greater currents.")  # fmt: skip
            yield Finding("friction-hides-load", text, name, Effect.INDETERMINATE)
        off = values - np.median(values)
        scatter = max(1.4826 * float(np.median(np.abs(off))), 1e-3 * most)
        place, load = np.unravel_index(int(np.argmax(np.abs(off))), off.shape)
        if abs(off[place, load]) > plan.far * scatter:
            text = (f"both sides differ by {2 * values[place, load]:.3g} there, and by {2 * np.median(values):.3g} "
                    f"elsewhere, in N or "
                    "N m: mistyped, or something touches.")  # fmt: skip
            yield Finding(
                "reading-far", text, f"{name}, {t.places[int(place)].name}, load {int(load)}", Effect.INDETERMINATE
            )


def of_results(r: Result, plan: Plan) -> Iterator[Finding]:
    """What certificates and data disagree about, what the formula lacks, what the other way to the map says."""
    yield from _certificates(r)
    for name, left, load in zip(("along", "around"), r.found.residuals, (r.rows.force, r.rows.torque), strict=True):
        share = float(np.sqrt(np.mean(left**2)) / np.abs(load).max())
        if share > plan.max_residual:
            text = (f"loads lie {share:.2%} (rms) of the greatest one beside the formula; {plan.max_residual:.2%} is "
                    f"allowed: the shaft was "
                    "not wound far enough, or the map has another form.")  # fmt: skip
            yield Finding("loads-beside-formula", text, name, Effect.INDETERMINATE)
    yield from _reciprocity(r)
    yield from _beside(r)


def _certificates(r: Result) -> Iterator[Finding]:
    at = Terms(len(r.rows.x))
    kinds = {k.identity: _kind(k.term, k.identity, at) for k in r.known}
    for identity, pull in fit.pulls(r.found, r.known).items():
        if abs(pull) > APART and kinds[identity] in TOLD:
            one = next(k for k in r.known if k.identity == identity)
            text = (f"loads say {r.found.terms[one.term]:.5g}; the certificate says {one.value:.5g}, u {one.u:.2g}: "
                    f"{pull:+.1f} standard "
                    "uncertainties off.")  # fmt: skip
            yield Finding(TOLD[kinds[identity]], text, identity, Effect.INDETERMINATE)


def _kind(term: int, identity: str, at: Terms) -> str:
    if identity.startswith("sensors/"):
        return "current" if term < at.each("offset").start else "offset"
    if term == at.cell("arm"):
        return "arm"
    return next((k for k in ("gain", "cross", "give") if f"/{k}" in identity and "load_cells" in identity), "")


def _reciprocity(r: Result) -> Iterator[Finding]:
    """Both cells read the slopes of one co-energy, whatever the map is."""
    e = r.estimates["reciprocity", ""]
    at = Terms(len(r.rows.x))
    stated = float(
        np.sqrt(sum(k.u**2 for k in r.known if k.term in (at.cell("cell_x"), at.cell("cell_angle"), at.cell("arm"))))
    )
    off = (e.value - 1) / np.hypot(e.u, stated)
    if abs(off) > APART:
        text = (f"the torque grows along by {e.value:.4f} of what the force grows around; certificates allow 1 to "
                f"{stated:.2g}: a cell's "
                "gain or the arm is not what they say.")  # fmt: skip
        yield Finding("cells-disagree", text, "", Effect.INDETERMINATE, CONCERNED)


def _beside(r: Result) -> Iterator[Finding]:
    if r.beside is None:
        yield Finding("no-other-map", "there is no other map that force and torque could be held against.", "")
        return
    force, torque = (r.estimates[name, ""] for name in ("force_ratio", "torque_ratio"))
    text = f"by load cells force is {force.value:.4f} and torque {torque.value:.4f} of what {r.beside.by} says."
    apart = any(abs(e.value - 1) > RATIO * e.u for e in (force, torque))
    if apart and any(e.u for e in r.beside.estimates):
        text = f"{text} Its uncertainties and those of the cells do not allow that."
        yield Finding("co-energy-apart", text, "", Effect.INDETERMINATE, CONCERNED)
    else:
        yield Finding("beside-other-map", text, "")
