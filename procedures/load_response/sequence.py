"""What is loaded, with what, and in which order."""

from __future__ import annotations

from dataclasses import dataclass

from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis
from procedures.load_response.plan import Plan
from procedures.stages.known_loads import Source, loaded, sources

INTEGRATORS = "integrators"


@dataclass(frozen=True)
class Put:
    """A load on an axis: a mass by its label on a source; "" and None are nothing."""

    source: Source | None
    label: str

    @property
    def name(self) -> str:
        """As findings call it."""
        return "nothing" if self.source is None else f"{self.label} {self.source.name}"


def chosen(rig: RigFile, plan: Plan) -> tuple[StageAxis, ...]:
    """The axes of the plan, in the rig's order."""
    units = {"along": "m", "around": "rad"}
    return tuple(a for a in loaded(rig) if units.get(plan.axes, a.unit) == a.unit)


def masses(axis: StageAxis, plan: Plan) -> tuple[str, ...]:
    """Labels, ascending."""
    return plan.lever_masses if axis.unit == "rad" else plan.masses


def order(rig: RigFile, axis: StageAxis, plan: Plan) -> tuple[Put, ...]:
    """Of an axis: nothing, each mass one way and the other, nothing. What carries one way cools while the other carries."""
    none = Put(None, "")
    return (none, *(Put(s, label) for label in masses(axis, plan) for s in sources(rig, axis)), none)


def changes(rig: RigFile, axis: StageAxis, plan: Plan) -> tuple[Put, ...]:
    """What disturbs an axis: the greatest mass each way."""
    return tuple(Put(s, masses(axis, plan)[-1]) for s in sources(rig, axis))


def lead(axis: StageAxis, plan: Plan) -> float:
    """How far the axis is moved past, m or rad."""
    return plan.lead_rad if axis.unit == "rad" else plan.lead_m


def slow(axis: StageAxis, plan: Plan) -> float:
    """Rate of moving back, m/s or rad/s."""
    return plan.slow_rad_s if axis.unit == "rad" else plan.slow_m_s


def count(axis: StageAxis) -> float:
    """m or rad of a count; 0 where the rig file does not tell it."""
    return 0.0 if axis.pitch is None else axis.pitch.value


def set_point(axis: StageAxis, plan: Plan, phase: int) -> float:
    """Within one count about zero, m or rad: never where a count has its middle, at which an integrator would rest."""
    return (phase + 0.5) / plan.phases * count(axis)


def step_count(rig: RigFile, plan: Plan) -> int:
    """Approaches and disturbances."""
    found = 0
    for axis in chosen(rig, plan):
        found += 2 * plan.phases * len(order(rig, axis, plan)) * plan.static
        found += 2 * plan.phases * len(changes(rig, axis, plan)) * plan.disturbed
    return found
