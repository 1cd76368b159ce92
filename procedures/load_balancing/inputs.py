"""What load balancing takes from calibrations and certificates, and what it tells the controller of the motor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from bench.calibration import Calibration
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.load_balancing.plan import Plan
from procedures.servomotor.conventions import conventions
from procedures.shared.certificates import certified, certified_gain, certified_sensors

USED: Mapping[str, tuple[str, ...]] = {
    "force-constant": ("alpha_d", "alpha_dx"),
    "negative-stiffness": ("alpha_x_prime",),
    "force-coupling": ("alpha_c", "alpha_ratio", "gamma_0"),
}
"""The calibrations, and what is taken of each."""
MODEL = ("alpha_d", "alpha_c", "stiffness")
LENGTHS = {"l_is": "com_to_inboard_sensor", "l_os": "com_to_outboard_sensor", "l_ia": "com_to_inboard_amb",
           "l_m": "com_to_motor"}  # fmt: skip


def of_amb_plane(l_is: float, l_os: float, l_ia: float, l_m: float) -> float:
    """alpha_x' with the inboard AMB's plane held over that with the inboard sensor's plane held (T (6.8)): both refer to the
    outboard sensors, and the controller holds the former."""
    return (l_ia + l_m) / (l_ia + l_os) * (l_is + l_os) / (l_is + l_m)


def adopted(rig: RigFile, values: Mapping[str, Estimate]) -> dict[str, float]:
    """What the controller is told of the motor, by meaning: alpha_d and alpha_c N/A, stiffness N/m at the outboard sensors."""
    lengths = {key: rig.geometry[name].value for key, name in LENGTHS.items()}
    return {"alpha_d": at_home(values).value, "alpha_c": values["alpha_c"].value,
            "stiffness": values["alpha_x_prime"].value * of_amb_plane(**lengths)}  # fmt: skip


def at_home(values: Mapping[str, Estimate]) -> Estimate:
    """The direct force constant at the home angle, where the ripple is in it: alpha_d of force-constant is a mean over a turn,
    up to 2.5 % off."""
    return values["alpha_ratio"] * values["alpha_c"]


def default(rig: RigFile) -> dict[str, float]:
    """The same as the rig file has it."""
    return {key: rig.parameters[rig.capabilities.model[key]].default for key in MODEL}


def told(rig: RigFile, plan: Plan, calibrations: Sequence[Calibration]) -> dict[str, float]:
    """The same as the plan has it."""
    return adopted(rig, merged(calibrations)) if plan.model == "adopted" else default(rig)


def merged(calibrations: Sequence[Calibration]) -> dict[str, Estimate]:
    """The values of those that are used, by name."""
    return {name: e for c in calibrations if c.procedure in USED for name, e in c.values.items()}


def of_recording(recording: Recording[Plan]) -> dict[str, Estimate]:
    """What the evaluation needs beside the turns, with influences by identity: alpha_d N/A, chi (the x winding's constant over
    the y winding's), ratio alpha_d/alpha_c, gamma_0 rad, alpha_x_prime N/m, levers m, gains of the outboard probes, gains and
    offsets of the segments' sensors."""
    rig = recording.rig
    values = merged([recording.calibration(name) for name in USED])
    machine = conventions(rig)
    inputs = {
        "alpha_d": at_home(values),
        "chi": values["alpha_dx"] / values["alpha_d"],
        "ratio": values["alpha_ratio"],
        "gamma_0": values["gamma_0"],
        "alpha_x_prime": values["alpha_x_prime"],
        "pole_pairs": Estimate.exact(rig.machine["pole_pairs"].value),
    }
    inputs |= {key: certified(f"geometry/{name}", rig.geometry[name]) for key, name in LENGTHS.items()}
    inputs |= {f"gain_{axis}": certified_gain(rig, machine.positions[axis]) for axis in ("xo", "yo")}
    return inputs | certified_sensors(rig, {f"m{k}": c for k, c in enumerate(machine.segments, 1)})
