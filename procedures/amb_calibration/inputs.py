"""What the fit of hanging masses needs besides the recording: the rig file's numbers, each as an influence by its identity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from bench.rigfile import RigFile
from bench.rigfile.numbers import Sum, Term
from bench.rigfile.places import Places
from bench.rigfile.supports import two_planes
from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import Estimate
from procedures.amb_calibration.pulls import Pull, against, tilt
from procedures.servomotor.loads import certified_masses, certified_weighing
from procedures.shared.certificates import certified, certified_sensors

HAND_RAD = (
    0.01745 / 3**0.5
)  # standard uncertainty of an angle by hand where shaft.hand_angle says nothing: within 1 degree


def fit_inputs(rig: RigFile, masses: Sequence[str], pull: Pull) -> dict[str, Estimate]:
    """By the names that `fit.fit` and `pulls.leans` ask for."""
    places, (near, far) = Places(rig), two_planes(rig)
    hook = places.distance(f"bearings/{far.name}", f"hooks/{pull.hook}")
    span = places.distance(f"bearings/{near.name}", f"bearings/{far.name}")
    out = certified_weighing(rig) | {
        "hook_to_outboard": summed(hook, f"span hook to {far.name} AMB"),
        "amb_span": summed(span, "span AMB to AMB"),
    }
    out |= _gaps(rig, places, (near.name, far.name)) | _motor(rig, places, f"bearings/{far.name}")
    out["hanger"] = certified("masses/hanger", rig.hanger, "hanger")
    out |= _directions(rig, places, pull) | certified_masses(rig, masses)
    coils = {f"{axis.key}{end}": coil for axis in pull.axes for end, coil in zip("pn", axis.coils, strict=True)}
    return out | certified_sensors(rig, coils)


def hand_rad(rig: RigFile) -> float:
    """Standard uncertainty of an angle to which the shaft is turned by hand, rad."""
    if rig.shaft is None or rig.shaft.hand_angle is None:
        return HAND_RAD
    return Places(rig).number(rig.shaft.hand_angle, "shaft.hand_angle").number.standard_uncertainty


def summed(of: Sum, name: str = "") -> Estimate:
    """A sum of numbers, each by its identity; `name` is what a budget calls it where there is one alone."""
    if len(of.terms) == 1 and not of.exact and of.terms[0].factor == 1:
        return certified(of.terms[0].identity, of.terms[0].number, name)
    total = Estimate.exact(of.exact)
    for term in of.terms:
        one = certified(term.identity, term.number, name if len(of.terms) == 1 else "")
        total = total + replace(one, unit="") * term.factor
    return total


def _term(term: Term, name: str) -> Estimate:
    return summed(Sum((term,)), name)


def _motor(rig: RigFile, places: Places, far: str) -> dict[str, Estimate]:
    """The pull of a motor's magnets off centre, where it has one; its place by the file's values."""
    for name, motor in rig.motors.items():
        if motor.stiffness is not None and motor.at is not None:
            lever = (places.place(f"motors/{name}") - places.place(far)).value
            stiffness = _term(
                places.number(motor.stiffness, f"motors.{name}.stiffness"), "motor stiffness (residual pos.)"
            )
            return {"motor_to_outboard": Estimate.exact(lever), "motor_stiffness": stiffness}
    return {}


def _gaps(rig: RigFile, places: Places, bearings: tuple[str, str]) -> dict[str, Estimate]:
    """Of both bearings, or of each."""
    terms = []
    for name in bearings:
        gap: Toleranced | str | None = rig.bearings[name].gap
        assert gap is not None  # requires asks for it
        terms.append(places.number(gap, f"bearings.{name}.gap"))
    if terms[0].identity == terms[1].identity:
        return {"amb_gap": _term(terms[0], "AMB gap (residual position)")}
    return {f"gap_{k}": _term(term, f"gap of {bearings[k]} (residual position)") for k, term in enumerate(terms)}


def _directions(rig: RigFile, places: Places, pull: Pull) -> dict[str, Estimate]:
    """Where they matter: directions of axes and of the pull, what a pulley loses, the tilt of a shaft that does not lie."""
    out: dict[str, Estimate] = {}
    for axis in pull.axes:
        if not axis.plumb:
            for name in (axis.name, axis.mate):
                out[f"at_{name}"] = summed(places.direction(f"bearings/{axis.bearing}/{name}"), f"direction of {name}")
    pulley = rig.hooks[pull.hook].pulley
    if pull.sideways:
        assert pulley is not None  # requires asks for it
        key = f"hooks.{pull.hook}.pulley"
        out["against"] = summed(against(rig, pull.hook), f"direction of the pull on {pull.hook}")
        out["friction"] = _term(
            places.number(pulley.friction, f"{key}.friction"), f"friction of the pulley of {pull.hook}"
        )
        out["misalignment"] = _term(
            places.number(pulley.misalignment, f"{key}.misalignment"), f"misalignment of the pulley of {pull.hook}"
        )
    if pull.tilted and (found := tilt(rig)) is not None:
        out["tilt"] = summed(found, "tilt of the shaft")
    return out
