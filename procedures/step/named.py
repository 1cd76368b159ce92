"""Settings of the controller as a plan asks for them: parameters by name, or what the rig file calls a set of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from bench.rigfile import RigFile
from procedures.step.plan import Plan


def setting_names(plan: Plan) -> tuple[str, ...]:
    """What the settings of a plan are called: one, or both that are compared."""
    return plan.names if plan.b else plan.names[:1]


def list_settings(plan: Plan, rig: RigFile) -> dict[str, dict[str, float]]:
    """The parameters of each setting, by its name."""
    return {name: written(of, rig) for name, of in zip(setting_names(plan), (plan.a, plan.b), strict=False)}


def written(asked: Mapping[str, float | str], rig: RigFile) -> dict[str, float]:
    """The parameters that are written for `law = "soft"` (a setting of the rig file by its kind) or `kp = 3`, the later of two
    that set the same.

    Raises:
        KeyError: the rig file has no such setting, which `check_settings` tells before.
    """
    out: dict[str, float] = {}
    for name, value in asked.items():
        out |= dict(rig.capabilities.settings[name][value]) if isinstance(value, str) else {name: value}
    return out


def check_settings(plan: Plan, rig: RigFile) -> Iterator[str]:
    """Named settings that the rig file does not have."""
    known = rig.capabilities.settings
    for key, asked in (("a", plan.a), ("b", plan.b), ("warm", plan.warm)):
        for kind, name in ((k, v) for k, v in asked.items() if isinstance(v, str) and v not in known.get(k, {})):
            names = ", ".join(known.get(kind, {}))
            expected = f"one of {names}" if names else "a number: the rig file names no settings of that kind"
            yield f"{key}: found {kind} = {name!r}; expected {expected}"
