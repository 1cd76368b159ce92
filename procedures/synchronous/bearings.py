"""What is known of the stand on which the balance of forces rests: rig file, and for the bearings an adopted calibration or the
plan."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.calibration import Calibration, Need
from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from bench.uncertainty.estimate import merged
from procedures.amb_rotor.conventions import conventions
from procedures.shared.certificates import certified
from procedures.synchronous.runout import arms

BEARING_MODEL = "bearing-model"


@dataclass(frozen=True)
class Known:
    """What is known of the bearings: an adopted `calibration`; where there is none, how far the controller's betas (half width
    `beta_share`, of them) and magnetic offsets (standard uncertainty `offset_u_m`, m) may be off."""

    calibration: Calibration | None
    beta_share: float
    offset_u_m: float

    @classmethod
    def of(cls, calibrations: Iterable[Calibration], beta_share: float, offset_u_m: float) -> Known:
        """By the calibrations that a run uses, and the plan's numbers where none of them is of the bearings."""
        return cls(next((c for c in calibrations if c.procedure == BEARING_MODEL), None), beta_share, offset_u_m)


def needs(bearings: str) -> tuple[Need, ...]:
    """The bearings' model, where the rig has one and the plan, by its key `bearings`, does not say otherwise."""
    return (Need(BEARING_MODEL, optional=True),) if bearings == "adopted" else ()


def describe(known: Known) -> Finding:
    """A note on what the forces rest on."""
    if (model := known.calibration) is not None:
        text = f"betas and magnetic offsets are those of {model.run_id}, {model.date[:10]}, with its influences"
    else:
        text = (f"no calibration bearing-model was used: betas are the controller's within ±{known.beta_share:.1%}, magnetic "
                f"offsets the controller's with u = {known.offset_u_m * 1e6:.3g} µm, as the plan says")  # fmt: skip
    return Finding("bearings", text, "", Effect.NOTE)


def collect_inputs(rig: RigFile, known: Known) -> dict[str, Estimate]:
    """What the rig file says of the stand (`runout.Stand`), with what is known of its bearings."""
    g = rig.geometry
    out = _probes_and_coils(rig)
    for name, key in (("gap", "amb_gap"), ("coupling", "coupling_stiffness"), ("l_ia", "com_to_inboard_amb"),
                      ("l_oa", "com_to_outboard_amb"), ("l_is", "com_to_inboard_sensor"), ("l_os", "com_to_outboard_sensor"),
                      ("l_iu", "com_to_inboard_balance"), ("l_ou", "com_to_outboard_balance"),
                      ("l_c", "com_to_coupling")):  # fmt: skip
        out[name] = certified(f"geometry/{key}", g[key], key.replace("_", " "))
    for name, key in (("mass", "mass"), ("inertia", "transverse_inertia"), ("polar", "polar_inertia")):
        out[name] = certified(f"machine/{key}", rig.machine[key], key.replace("_", " "))
    return out | (
        _planned(rig, known)
        if known.calibration is None
        else _calibrated(out, conventions(rig).axes, known.calibration)
    )


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
    v = {name: known[name].value for name in ("l_ia", "l_oa", "l_is", "l_os")}
    at_bearing = arms(v["l_ia"], v["l_oa"]) @ np.linalg.inv(arms(v["l_is"], v["l_os"]))
    out = {}
    for k, a in enumerate(axes):
        out[f"beta_{k}"] = model.values[f"beta_{a}"]
        terms = [(float(at_bearing[k, j]) / known[f"gain_{j}"].value, known[f"zero_{j}"]) for j in range(4)]
        offset = model.values[f"offset_{a}"]
        value = offset.value + sum(w * e.value for w, e in terms)
        out[f"offset_{k}"] = Estimate(value, "m", merged([(1.0, offset), *terms]))
    return out


def _probes_and_coils(rig: RigFile) -> dict[str, Estimate]:
    out: dict[str, Estimate] = {}
    machine = conventions(rig)
    for start, names in (("", machine.positions), ("i_", machine.currents)):
        for k, name in enumerate(names):
            sensor = rig.sensors[name]
            out[f"{start}gain_{k}"] = certified(f"sensors/{name}/gain", sensor.gain, f"gain of {name}")
            out[f"{start}zero_{k}"] = certified(f"sensors/{name}/offset", sensor.offset, f"zero of {name}")
    return out


def _bound(identity: str, name: str, value: float, u: float, distribution: str) -> Estimate:
    return Estimate.of(value, Influence(identity, name, u, "", "B", distribution))  # type: ignore[arg-type]
