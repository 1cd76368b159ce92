"""What the servomotor's controller is asked for, by what it does; the rig file has the names of the parameters.

`bias.near`, `bias.far`: of the AMB nearer to the near end and of the other. `at.yi`, `at.xi`, `at.yo`, `at.xo`: set points in
their planes. `angle.*` and `motor.*` are the keys of `[capabilities]`.
"""

from __future__ import annotations

from collections.abc import Mapping

from bench.errors import Lacking
from bench.procedure.rig import Rig
from bench.rigfile import RigFile
from bench.rigfile.capabilities import parameters_named
from bench.rigfile.model import Parameter
from bench.rigfile.supports import once_per_rig
from procedures.servomotor.conventions import conventions

BIASES = ("bias.near", "bias.far")
CURRENTS = {"i_x": "motor.across", "i_y": "motor.along"}  # labels of steps


@once_per_rig
def _bound(rig: RigFile) -> Mapping[str, str]:
    machine, known = conventions(rig), dict(parameters_named(rig.capabilities))
    out = {key: name for key, name in known.items() if key.startswith(("angle.", "motor."))}
    for key, bearing in zip(BIASES, machine.bearings, strict=True):
        out |= {key: known[f"bias.{bearing}"]} if f"bias.{bearing}" in known else {}
    for role, axis in machine.axes.items():
        out |= {f"at.{role}": name for name in [known.get(f"set_points.axes.{axis}")] if name}
    return out


def parameter(rig: RigFile, key: str) -> str:
    """The name of the parameter that does it.

    Raises:
        Lacking: the controller has none.
    """
    if key not in _bound(rig):
        raise Lacking(f"capabilities: found no {key}")
    return _bound(rig)[key]


def needed(rig: RigFile, *keys: str) -> tuple[str, ...]:
    """Their names, for what a procedure requires; the key itself where the controller has none."""
    return tuple(_bound(rig).get(key, key) for key in keys)


def stated(rig: RigFile, key: str) -> Parameter:
    """Its range and default.

    Raises:
        Lacking: the controller has none.
    """
    return rig.parameters[parameter(rig, key)]


def named(rig: RigFile, values: Mapping[str, float]) -> dict[str, float]:
    """Values by the names of the parameters.

    Raises:
        Lacking: the controller has none for one of them.
    """
    return {parameter(rig, key): value for key, value in values.items()}


def chosen(rig: RigFile, kind: str, name: str) -> dict[str, float]:
    """The parameters that choose a setting, by their names.

    Raises:
        Lacking: the controller has none of that name.
    """
    known = rig.capabilities.settings.get(kind, {})
    if name not in known:
        raise Lacking(f"capabilities.settings.{kind}: found no {name}; it has {', '.join(known) or 'none'}")
    return dict(known[name])


def write(rig: Rig, values: Mapping[str, float]) -> None:
    """Write them, in that order; those of one message in one message.

    Raises:
        Lacking: the controller has none for one of them.
    """
    rig.levitation.write(named(rig.file, values))
