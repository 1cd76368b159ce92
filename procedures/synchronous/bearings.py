"""What is known of the stand on which the balance of forces rests: rig file, and for the bearings an adopted calibration or the
plan."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bench.calibration import Calibration, Need
from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from bench.uncertainty.estimate import merged
from procedures.amb_rotor.conventions import conventions
from procedures.shared.certificates import certified
from procedures.synchronous.facts import collect_lengths
from procedures.synchronous.runout import Stand

BEARING_MODEL = "bearing-model"


@dataclass(frozen=True)
class Known:
    """What is known of the bearings: an adopted `calibration`; where there is none, how far the controller's betas (half width
    `beta_share`, of them) and magnetic offsets (standard uncertainty `offset_u_m`, m) may be off. `found` are the force
    constants that the turning shaft itself told, where the controller knows none."""

    calibration: Calibration | None
    beta_share: float
    offset_u_m: float
    found: Mapping[str, Estimate] = field(default_factory=dict)

    @classmethod
    def of(cls, calibrations: Iterable[Calibration], beta_share: float, offset_u_m: float) -> Known:
        """By the calibrations that a run uses, and the plan's numbers where none of them is of the bearings."""
        return cls(next((c for c in calibrations if c.procedure == BEARING_MODEL), None), beta_share, offset_u_m)


def needs(bearings: str) -> tuple[Need, ...]:
    """The bearings' model, where the rig has one and the plan, by its key `bearings`, does not say otherwise."""
    return (Need(BEARING_MODEL, optional=True),) if bearings == "adopted" else ()


def describe(known: Known) -> Finding:
    """A note on what the forces rest on."""
    if known.found:
        sizes = ", ".join(f"{e.value:.3g} ± {2 * e.u / e.value:.1%}" for e in known.found.values())
        text = (f"the controller knows no force constants and no calibration bearing-model was used: the dwells tell "
                f"them by the shaft's mass and inertia, {sizes} N m²/A² by axis; magnetic centres are taken for the rings' "
                f"with u = {known.offset_u_m * 1e6:.3g} µm")  # fmt: skip
    elif (model := known.calibration) is not None:
        text = f"betas and magnetic offsets are those of {model.run_id}, {model.date[:10]}, with its influences"
    else:
        text = (f"no calibration bearing-model was used: betas are the controller's within ±{known.beta_share:.1%}, magnetic "
                f"offsets the controller's with u = {known.offset_u_m * 1e6:.3g} µm, as the plan says")  # fmt: skip
    return Finding("bearings", text, "", Effect.NOTE)


def unknown(known: Known, rig: RigFile) -> Iterator[Finding]:
    """Nothing tells the bearings' forces: no runout can be told from the shaft's motion."""
    if known.calibration is None and not known.found and not has_model(rig):
        text = ("nothing tells what the bearings' forces are: the controller knows no force constants, no calibration "
                "bearing-model was used, and fewer than three speeds, slow roll included, do not tell them.")  # fmt: skip
        yield Finding("bearings-unknown", text, "", Effect.ERROR)


def collect_inputs(rig: RigFile, known: Known) -> dict[str, Estimate]:
    """What the rig file says of the stand (`runout.Stand`), with what is known of its bearings.

    Raises:
        Lacking: the rig file does not say enough of the shaft.
    """
    out = {**_probes_and_coils(rig), **collect_lengths(rig)}
    if known.calibration is not None:
        return out | _calibrated(out, conventions(rig).axes, known.calibration)
    return out | (_planned(rig, known) if has_model(rig) else {**_centred(rig, known), **known.found})


def has_model(rig: RigFile) -> bool:
    """Whether the controller knows force constants and magnetic offsets of all axes."""
    machine = conventions(rig)
    return all(machine.model_beta(a) and machine.model_offset(a) for a in machine.axes)


def _centred(rig: RigFile, known: Known) -> dict[str, Estimate]:
    """Magnetic centres in the middle of the rings, as far off as the plan says; force constants of nothing, until they are
    found (`found`)."""
    out = {}
    for k, a in enumerate(conventions(rig).axes):
        out[f"beta_{k}"] = Estimate.exact(0.0, "N m^2/A^2")
        out[f"offset_{k}"] = _bound(f"model/offset_{a}", f"magnetic offset of {a}", 0.0, known.offset_u_m, "normal")
    return out


def _planned(rig: RigFile, known: Known) -> dict[str, Estimate]:
    """The controller's betas and magnetic offsets, as far off as the plan says."""
    out, p, machine = {}, rig.parameters, conventions(rig)
    for k, a in enumerate(machine.axes):
        beta, offset = (p[name].default for name in (machine.model_beta(a), machine.model_offset(a)))
        out[f"beta_{k}"] = _bound(
            f"model/beta_{a}", f"beta of {a}", beta, known.beta_share * beta / math.sqrt(3), "rectangular"
        )
        out[f"offset_{k}"] = _bound(f"model/offset_{a}", f"magnetic offset of {a}", offset, known.offset_u_m, "normal")
    return out


def _calibrated(known: Mapping[str, Estimate], axes: Sequence[str], model: Calibration) -> dict[str, Estimate]:
    """Those of a calibration. Its offsets lead to where the probes read zero, these to the rings' centre: less what the
    zeros are at the bearings' planes, which then does not act on the forces any more."""
    none = {f"{name}_{k}": 0.0 for name in ("beta", "offset") for k in range(4)}
    s = Stand.of(none | {name: e.value for name, e in known.items()})
    at_bearing = s.axes @ np.linalg.inv(s.probes)
    out = {}
    for k, a in enumerate(axes):
        out[f"beta_{k}"] = _fact(model, "beta", a)
        terms = [(float(at_bearing[k, j]) / known[f"gain_{j}"].value, known[f"zero_{j}"]) for j in range(4)]
        offset = _fact(model, "offset", a)
        value = offset.value + sum(w * e.value for w, e in terms)
        out[f"offset_{k}"] = Estimate(value, "m", merged([(1.0, offset), *terms]))
    return out


def _fact(model: Calibration, kind: str, axis: str) -> Estimate:
    """Of an axis, by its name or as the AMB stand of the thesis calls it."""
    for name in (f"{kind}@{axis}", f"{kind}_{axis}"):
        if name in model.values:
            return model.values[name]
    raise AnalysisError(f"the calibration {model.procedure} ({model.run_id}) has no {kind}@{axis}")


def _probes_and_coils(rig: RigFile) -> dict[str, Estimate]:
    out: dict[str, Estimate] = {}
    machine = conventions(rig)
    for start, names in (("", machine.positions), ("i_", machine.currents)):
        for k, name in enumerate(names):
            sensor = rig.sensors[name]
            gain = certified(f"sensors/{name}/gain", sensor.gain, f"gain of {name}")
            out[f"{start}gain_{k}"] = gain * -1.0 if not start and _reads_back(rig, name) else gain
            out[f"{start}zero_{k}"] = certified(f"sensors/{name}/offset", sensor.offset, f"zero of {name}")
    return out


def _reads_back(rig: RigFile, channel: str) -> bool:
    return any(p.channel == channel and p.sign < 0 for p in rig.probes.values())


def _bound(identity: str, name: str, value: float, u: float, distribution: str) -> Estimate:
    return Estimate.of(value, Influence(identity, name, u, "", "B", distribution))  # type: ignore[arg-type]
