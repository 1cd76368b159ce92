"""What the protocol's own names of parameters and bits mean, for a rig file that does not say what its controller can do."""

from __future__ import annotations

from typing import Any

Content = dict[str, Any]
TIMES = {"landing_speed": "landing_speed", "lift_time": "lift_time_s", "watchdog": "watchdog_s",
         "current_limit": "current_limit"}  # fmt: skip
BIAS = {"inboard": ("bias", "bias_i"), "outboard": ("bias", "bias_o"), "axial": ("bias_z",)}
GAINS = {"yi": "i", "xi": "i", "yo": "o", "xo": "o", "z": "z"}
PATH = ("on", "y", "z", "hz", "phase", "ramp_s", "ratio")
INJECTION = ("amplitude", "hz", "lines", "step")
MOTOR = {
    "along": "i_y", "across": "i_x", "ramp": "i_ramp", "phase": "gamma",
    "ref_along": "ref_ym", "ref_across": "ref_xm", "share": "motor_share", "share_slew": "share_slew",
    "segment_limit": "segment_max", "allocation": "allocation", "sine": "sine_amplitude", "sine_hz": "sine_hz",
    "phase_slew": "gamma_slew", "phase_limit": "gamma_max", "circle": "circle_radius", "circle_hz": "circle_hz",
}  # fmt: skip
ANGLE = {"slew": "angle_slew", "speed": "speed_ref", "kp": "kp_theta", "ki": "ki_theta", "kd": "kd_theta",
         "low_pass_hz": "angle_hz", "derivative_on_error": "derivative_on_error"}  # fmt: skip
LAWS = {"PID": {"law": 0}, "CCS": {"law": 1}, "CAC": {"law": 2}}
FLATNESS = ("k0", "k1", "integral", "derivative_hz")
LIFT = {"plain": {"law": 0, "observer": 0, "compensate": 0}}
POLES = {"observed": {"k1": 2e5, "k2_ccs": 400, "k2_cac": 400}}
INTEGRATOR = {"on": {"integral": 1}}
COMPENSATION = {
    "off": {"observer": 0, "compensate": 0, "integral": 1},
    "corrected": {"observer": 1, "compensate": 3, "integral": 0},
    "literal": {"observer": 2, "compensate": 3, "integral": 0},
    "waiting": {"observer": 1, "compensate": 0, "integral": 0},
}
MOTOR_SETTINGS = {
    "sharing": {"static": {"allocation": 0}, "priority": {"allocation": 1}, "half": {"allocation": 2}},
    "lifted_by": {"bearing": {"lift_by": 0}, "motor": {"lift_by": 1}},
    "torque": {"held": {"torque_limit_run": 0}, "limit": {"torque_limit_run": 1}},
    "commutation": {"late": {"lag_compensation": 0}, "ahead": {"lag_compensation": 1}},
    "load_balancing": {"off": {"balance": 0}, "on": {"balance": 1}},
}
"""Of a motor whose law has all of them: an older one knows no allocation 2."""
STAND = {
    "contact": {"inboard": 4, "outboard": 8, "axial": 32},
    "current_limit": 1,
    "voltage_limit": 2,
    "sensor_range": 64,
}
SERVOMOTOR = {"contact": {"inboard": 4, "outboard": 8}, "current_limit": 1, "segment_limit": 2}


def with_capabilities(data: Content) -> Content:
    """The content of a rig file of schema 2; where it has no table `capabilities`, one by the names of its parameters,
    channels, bearings and rings."""
    if "capabilities" in data:
        return data
    p, channels, bearings, rings = (
        table if isinstance(table := data.get(name), dict) else {}
        for name in ("parameters", "channels", "bearings", "rings")
    )
    axes = [axis for b in bearings.values() if isinstance(b, dict) for axis in b.get("axes", ())]
    return {**data, "capabilities": capabilities_by_name(p, channels, bearings, rings, axes)}


def capabilities_by_name(p: Content, channels: Content, bearings: Content, rings: Content, axes: list[str]) -> Content:
    """What parameters and bits are by their names in the protocol, for a machine with such parts."""
    out: Content = {key: name for key, name in TIMES.items() if name in p}
    out["bias"] = {b: found for b, names in BIAS.items() if b in bearings and (found := _first(names, p))}
    out["gains"] = {key: made for key in ("kp", "ki", "kd") if (made := _gain(key, axes, p))}
    out["set_points"] = _set_points(axes, p)
    out["settings"] = _settings(p)
    out["model"] = {name.removeprefix("model_"): name for name in p if name.startswith("model_")}
    if {"law", "k0", "k1", "k2_ccs", "k2_cac"} <= p.keys():
        out["flatness"] = {
            law: {"k2": f"k2_{law.lower()}", **{key: key for key in FLATNESS if key in p}} for law in ("CCS", "CAC")
        }
    out["motor"] = {key: name for key, name in MOTOR.items() if name in p}
    if {"ellipse_on", "ellipse_y", "ellipse_z", "ellipse_hz"} <= p.keys():
        out["path"] = {key: f"ellipse_{key}" for key in PATH if f"ellipse_{key}" in p}
    if {"inject_axis", "inject_amplitude", "inject_hz"} <= p.keys() and axes:
        fields = {key: f"inject_{key}" for key in INJECTION if f"inject_{key}" in p}
        out["injection"] = {"axis": "inject_axis", "axes": {a: k for k, a in enumerate(axes)}, "off": -1, **fields}
    if "angle_ref" in p:
        out["angle"] = {"ref": "angle_ref", **{key: name for key, name in ANGLE.items() if name in p}}
    out["status"] = _status(STAND if "law" in p else SERVOMOTOR, bearings, rings) if "flags" in channels else {}
    return {key: made for key, made in out.items() if made}


def _first(names: tuple[str, ...], p: Content) -> str:
    return next((name for name in names if name in p), "")


def _gain(key: str, axes: list[str], p: Content) -> Any:
    if key in p:
        return key
    return {axis: name for axis in axes if (name := f"{key}_{GAINS.get(axis, '')}") in p}


def _set_points(axes: list[str], p: Content) -> Content:
    """By coordinate of the shaft where the parameters say so, else by axis."""
    if "ref_psi" in p:
        shaft = {name: f"ref_{name}" for name in ("x", "y", "z", "psi", "theta") if f"ref_{name}" in p}
        return {"shaft": shaft, **{name: name for name in ("slew", "slew_tilt") if name in p}}
    found = {axis: f"ref_{axis}" for axis in axes if f"ref_{axis}" in p}
    return {"axes": found} if found else {}


def _settings(p: Content) -> Content:
    out: Content = {"law": LAWS} if "law" in p else {}
    if {"observer", "compensate", "integral"} <= p.keys():
        out["compensation"] = COMPENSATION
        out["integrator"] = INTEGRATOR
        out |= {"lift": LIFT} if "law" in p else {}
    if {"k1", "k2_ccs", "k2_cac"} <= p.keys():
        out["poles"] = POLES
    if {"allocation", "lift_by", "torque_limit_run", "lag_compensation", "balance"} <= p.keys():
        out |= MOTOR_SETTINGS
    return out


def _status(bits: Content, bearings: Content, rings: Content) -> Content:
    """The bits of channel `flags`; contact where the shaft has something to touch."""
    stops = {
        **rings,
        **{name: None for name, b in bearings.items() if isinstance(b, dict) and b.get("kind") == "axial"},
    }
    contact = {name: {"channel": "flags", "mask": mask} for name, mask in bits["contact"].items() if name in stops}
    single = {key: {"channel": "flags", "mask": mask} for key, mask in bits.items() if key != "contact"}
    return {**({"contact": contact} if contact else {}), **single}
