"""An adopted bearing-model for a stand whose truth is known."""

from __future__ import annotations

from typing import Any

import numpy as np
from amb_stand import AMB_ROTOR

from bench.calibration import Calibration
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.synchronous import runout
from procedures.synchronous.bearings import Known
from sim_backend.machines.amb5dof.params import AmbParams


def known(plan: Any, *calibrations: Calibration) -> Known:
    """What a run with that plan and these calibrations knows of the bearings."""
    return Known.of(calibrations, plan.beta_share, plan.offset_u_m)


def bearings(rig: RigFile, plant: AmbParams) -> Calibration:
    """What bearing-model would state of that plant: offsets to where the probes read zero, with smaller influences."""
    at_bearing = runout.arms(plant.l_ia, plant.l_oa) @ np.linalg.inv(runout.arms(plant.l_is, plant.l_os))
    zero = at_bearing @ (np.array(plant.position_offset[:4]) / np.array(plant.position_gain[:4]))
    values = {}
    for k, a in enumerate(AMB_ROTOR.axes):
        for name, value, u in (("beta", plant.beta[k], 1e-9), ("offset", plant.offset[k] - zero[k], 1e-6)):
            values[f"{name}_{a}"] = Estimate.of(float(value), Influence(f"{name}-{a}", name, u, "", "B", "normal"))
    return Calibration(
        "bearing-model",
        values,
        run_id="bearing-model-1",
        date="2026-02-03T00:00:00+00:00",
        due="2027-02-03",
        rig=rig.name,
        backend="served",
        sha256="0" * 64,
    )
