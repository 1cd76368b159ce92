"""What is known of the stand on which the balance of forces rests: rig file, and for the bearings an adopted calibration or the
plan."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from bench.calibration import Calibration
from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from bench.uncertainty.estimate import merged
from procedures.amb_rotor.channels import AXES, COILS
from procedures.shared.certificates import certified
from procedures.synchronous.runout import arms

BEARING_MODEL = "bearing-model"


class Settings(Protocol):
    """The part of a plan that the estimates need."""

    @property
    def beta_share(self) -> float: ...
    @property
    def offset_u_m(self) -> float: ...


class Calibrated(Protocol):
    """A recording, or one under way."""

    @property
    def calibrations(self) -> tuple[Calibration, ...]: ...


def adopted_bearings(recording: Calibrated) -> Calibration | None:
    """The bearings' calibration that a run used, if it used one."""
    return next((c for c in recording.calibrations if c.procedure == BEARING_MODEL), None)


def told(model: Calibration | None, plan: Settings) -> Finding:
    """A note on what the forces rest on."""
    if model is None:
        text = (f"no calibration bearing-model was used: betas are the controller's within ±{plan.beta_share:.1%}, magnetic "
                f"offsets the controller's with u = {plan.offset_u_m * 1e6:.3g} µm, as the plan says")  # fmt: skip
    else:
        text = f"betas and magnetic offsets are those of {model.run_id}, {model.date[:10]}, with its influences"
    return Finding("bearings", text, "", Effect.NOTE)


STATED = tuple(f"model_{what}_{a}" for what in ("beta", "offset") for a in AXES)
"""Parameters that say what the controller knows of the bearings, where no calibration does."""


def stated(rig: RigFile, plan: Settings, model: Calibration | None = None) -> dict[str, Estimate]:
    """What the rig file and the plan, or the bearings' calibration, say of the stand (`runout.Stand`)."""
    g = rig.geometry
    out = _probes_and_coils(rig)
    for name, key in (("gap", "amb_gap"), ("coupling", "coupling_stiffness"), ("l_ia", "com_to_inboard_amb"),
                      ("l_oa", "com_to_outboard_amb"), ("l_is", "com_to_inboard_sensor"), ("l_os", "com_to_outboard_sensor"),
                      ("l_iu", "com_to_inboard_balance"), ("l_ou", "com_to_outboard_balance"),
                      ("l_c", "com_to_coupling")):  # fmt: skip
        out[name] = certified(f"geometry/{key}", g[key], key.replace("_", " "))
    for name, key in (("mass", "mass"), ("inertia", "transverse_inertia"), ("polar", "polar_inertia")):
        out[name] = certified(f"machine/{key}", rig.machine[key], key.replace("_", " "))
    return out | (_planned(rig, plan) if model is None else _calibrated(out, model))


def _planned(rig: RigFile, plan: Settings) -> dict[str, Estimate]:
    """The controller's betas and magnetic offsets, as far off as the plan says."""
    out, p = {}, rig.parameters
    for k, a in enumerate(AXES):
        beta, offset = p[f"model_beta_{a}"].default, p[f"model_offset_{a}"].default
        out[f"beta_{k}"] = _bound(
            f"model/beta_{a}", f"beta of {a}", beta, plan.beta_share * beta / math.sqrt(3), "rectangular"
        )
        out[f"offset_{k}"] = _bound(f"model/offset_{a}", f"magnetic offset of {a}", offset, plan.offset_u_m, "normal")
    return out


def _calibrated(known: Mapping[str, Estimate], model: Calibration) -> dict[str, Estimate]:
    """Those of a calibration. Its offsets lead to where the probes read zero, these to the rings' centre: less what the
    zeros are at the bearings' planes, which then does not act on the forces any more."""
    v = {name: known[name].value for name in ("l_ia", "l_oa", "l_is", "l_os")}
    at_bearing = arms(v["l_ia"], v["l_oa"]) @ np.linalg.inv(arms(v["l_is"], v["l_os"]))
    out = {}
    for k, a in enumerate(AXES):
        out[f"beta_{k}"] = model.values[f"beta_{a}"]
        terms = [(float(at_bearing[k, j]) / known[f"gain_{j}"].value, known[f"zero_{j}"]) for j in range(4)]
        offset = model.values[f"offset_{a}"]
        value = offset.value + sum(w * e.value for w, e in terms)
        out[f"offset_{k}"] = Estimate(value, "m", merged([(1.0, offset), *terms]))
    return out


def _probes_and_coils(rig: RigFile) -> dict[str, Estimate]:
    out: dict[str, Estimate] = {}
    for k, a in enumerate(AXES):
        sensor = rig.sensors[f"pos_{a}"]
        out[f"gain_{k}"] = certified(f"sensors/pos_{a}/gain", sensor.gain, f"gain of pos_{a}")
        out[f"zero_{k}"] = certified(f"sensors/pos_{a}/offset", sensor.offset, f"zero of pos_{a}")
    for k, c in enumerate(COILS):
        sensor = rig.sensors[f"i_{c}"]
        out[f"i_gain_{k}"] = certified(f"sensors/i_{c}/gain", sensor.gain, f"gain of i_{c}")
        out[f"i_zero_{k}"] = certified(f"sensors/i_{c}/offset", sensor.offset, f"zero of i_{c}")
    return out


def _bound(identity: str, name: str, value: float, u: float, distribution: str) -> Estimate:
    return Estimate.of(value, Influence(identity, name, u, "", "B", distribution))  # type: ignore[arg-type]
