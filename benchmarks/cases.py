"""The cases of the sound rigs: each procedure with its default plan, alone and in the chain, and with each choice of it."""

from __future__ import annotations

import importlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from pydantic import ValidationError

from bench import catalogue
from bench.cli.abilities import abilities
from bench.procedure import BenchPlan, Procedure
from bench.rigfile import load_rig

RPM = math.pi / 30
RIGS = {
    "tsbs12": ("amb-calibration", "force-constant", "negative-stiffness", "force-coupling", "torque-constant", "spindown",
               "angle-step", "lift-off", "slew", "force-map", "load-balancing"),
    "tsbs12-offset": ("load-balancing",),
    "tsbs12-drag": ("maximum-speed",),
    "amb5dof": ("bearing-model", "step", "tracking", "unbalance", "compensation", "balance", "run-up", "coast-down",
                "sensitivity"),
    "amb1dof": ("derivative", "estimator-compare"),
    "lira": ("coil-map", "encoder-zero", "unstable-pole", "loop-response", "mission", "gate-margin", "actuator-constant"),
    "lira-200v": ("current-step",),
    "rlsrm": ("step-following", "sine-following", "decoupling"),
    "tsbs6": ("amb-calibration", "torque-constant", "spindown", "angle-step", "slew"),
}  # fmt: skip
FOREIGN = {
    "examples/vertical-spindle/spindle.toml": ("step", "unbalance", "balance", "run-up", "coast-down"),
    "examples/plain-stand/stand.toml": ("amb-calibration", "bearing-model", "step", "sensitivity"),
}
"""Rigs of the examples, by their twins: default plans alone."""
ENDS: Mapping[str, tuple[Mapping[str, Any], ...]] = {
    "amb-calibration": ({"bias_A": 2.5}, {"bias_A": 4.0}),
    "torque-constant": ({"bias_A": 2.0}, {"bias_A": 4.0}),
    "spindown": ({"speed_rad_s": 30.0}, {"speed_rad_s": 70.0}),
    "maximum-speed": ({"limit_A": 7.0}, {"limit_A": 8.0}),
    "step": (
        {"speeds_rad_s": (3000 * RPM,)},
        {"speeds_rad_s": (10000 * RPM,)},
        {"a": {"law": 0}},
        {"a": {"law": 1}},
        {"a": {"law": 2}},
    ),
    "unbalance": ({"speeds_rad_s": (2000 * RPM,)}, {"speeds_rad_s": (14000 * RPM,)}),
    "compensation": (
        {"speeds_rad_s": (3000 * RPM,)},
        {"speeds_rad_s": (14000 * RPM,), "judged_to_rad_s": 14000 * RPM},
    ),
    "balance": ({"speeds_rad_s": (3000 * RPM,)}, {"positions": 12}),
    "run-up": (
        {"acceleration_rad_s2": 10.0},
        {"acceleration_rad_s2": 50.0},
        {"law": "CAC", "top_rad_s": 8000 * RPM, "speeds_rad_s": (3000 * RPM, 6000 * RPM)},
    ),
    "coast-down": ({"deceleration_rad_s2": 24.5},),
    "tracking": ({"laws": ["PID"], "y_m": 20e-6, "z_m": 20e-6},),
    "sensitivity": ({"speeds_rad_s": (10000 * RPM,)},),
    "derivative": ({"degree": 8}, {"degree": 6}),
    "current-step": ({"steps_at": ("B2_d",)},),
}
"""Biases, speeds and rates at both ends; choices among words are read from the plans themselves."""
# a choice that truly touches the rings with the plan's own ellipse, as the procedure's page says: tried with a smaller one
TOUCHING = {("tracking", '{"laws": ["PID"]}')}
# what the operator has done to the machine for a plan, by the case's name
TRUTH: Mapping[str, Mapping[str, float]] = {'bearing-model {"coupled": false}': {"geometry.coupling_stiffness": 0.0}}


@dataclass(frozen=True)
class Case:
    """A procedure with what differs from its default plan; `chain`: with every calibration that it can use."""

    rig: str
    procedure: str
    changes: str  # JSON
    chain: bool

    @property
    def name(self) -> str:
        return f"{self.procedure} {self.changes if self.changes != '{}' else ''}{' in the chain' if self.chain else ''}"


def cases_of(rig: str, only: list[str]) -> Iterator[Case]:
    """Default plans alone and in the chain, then each choice, of a rig's procedures."""
    for name in RIGS[rig]:
        if only and name not in only:
            continue
        procedure = load(name)
        needs = procedure.needs(procedure.plan())
        if all(n.optional for n in needs):
            yield Case(rig, name, "{}", False)
        if needs:
            yield Case(rig, name, "{}", True)
        for changes in (*choices(procedure), *ENDS.get(name, ())):
            if (name, json.dumps(changes)) in TOUCHING:
                continue
            if (plan := plan_of(rig, procedure, changes)) is not None:
                yield Case(rig, name, json.dumps(changes), bool(procedure.needs(plan)))


def foreign_cases(rig: str, only: list[str]) -> Iterator[Case]:
    """Default plans, alone where no calibration is needed, and in the chain where the rig can make what it uses."""
    for name in FOREIGN[rig]:
        procedure = load(name)
        needs = procedure.needs(procedure.plan())
        if only and name not in only:
            continue
        if all(n.optional for n in needs):
            yield Case(rig, name, "{}", False)
        if needs and {*needed_by(name)} <= {*FOREIGN[rig]}:
            yield Case(rig, name, "{}", True)


def able_cases(rig: str, only: list[str]) -> Iterator[Case]:
    """The default plan of every procedure that a rig can run, of those that ask for no calibration."""
    for ability in abilities(load_rig(rig)):
        wanted = ability.able and (not only or ability.procedure in only)
        if wanted and all(n.optional for n in load(ability.procedure).needs(load(ability.procedure).plan())):
            yield Case(rig, ability.procedure, "{}", False)


def plan_of(rig: str, procedure: Procedure, changes: Mapping[str, Any]) -> BenchPlan | None:
    """The rig's plan with `changes`, as JSON has them; nothing for a choice that is refused before anything turns, as it goes
    with another one only."""
    file = load_rig(rig)
    try:
        plan = procedure.plan.model_validate({**file.plans.get(procedure.name, {}), **changes})
    except ValidationError:
        return None
    return None if list(procedure.check(file, plan)) else plan


def choices(procedure: Procedure) -> Iterator[dict[str, Any]]:
    """Every other choice that the plan offers among words, and every switch the other way."""
    for key, field in procedure.plan.model_fields.items():
        usual, kind = field.get_default(call_default_factory=True), field.annotation
        if kind is bool:
            yield {key: not usual}
        elif get_origin(kind) is Literal:
            yield from ({key: value} for value in get_args(kind) if value != usual)
        elif get_origin(kind) is tuple and get_origin(get_args(kind)[0]) is Literal:
            yield from ({key: [value]} for value in get_args(get_args(kind)[0]) if (value,) != usual)


def load(name: str) -> Procedure:
    found: Procedure = importlib.import_module(catalogue.entry(name).module).procedure
    return found


def needed(cases: list[Case]) -> dict[str, dict[str, Any]]:
    """As needed_by, for all of them."""
    out: dict[str, dict[str, Any]] = {}
    for case in cases:
        if case.chain:
            out = needed_by(case.procedure, json.loads(case.changes)) | out
    return out


def needed_by(procedure: str, changes: Mapping[str, Any] | None = None) -> dict[str, dict[str, Any]]:
    """Procedures whose calibrations one uses, in the order in which they can be made, with the switches that they are needed
    at; the other settings that a need names are those of the default plans."""
    out: dict[str, dict[str, Any]] = {}

    def add(name: str, changes: Mapping[str, Any]) -> None:
        procedure = load(name)
        for need in procedure.needs(procedure.plan.model_validate(changes)):
            if need.procedure not in out:
                fields = load(need.procedure).plan.model_fields
                switches = {
                    k: bool(v) for k, v in need.settings.items() if k in fields and fields[k].annotation is bool
                }
                add(need.procedure, switches)
                out[need.procedure] = switches

    add(procedure, changes or {})
    return out
