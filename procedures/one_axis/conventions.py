"""What a machine of one magnetic axis calls its things, and what its controller is asked for by meaning.

A procedure asks once, `machine = conventions(rig)`, and hands it on. Estimators are settings of the controller: of kind
"estimator" what closes the loop, of kind "watched" whose velocity is told while a plain one closes it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bench.errors import Lacking
from bench.rigfile import RigFile
from bench.rigfile.capabilities import Capabilities
from bench.rigfile.supports import once_per_rig, radial_supports

VELOCITY, LOAD, HARMONIC = "velocity", "load", "harmonic"
"""What a capture of the controller calls its estimates: of the velocity, and of the disturbance's two parts."""


@dataclass(frozen=True)
class OneAxis:
    """The names of one machine: its `axis`, the channels of its `position` and of its two coils' `currents`, and what its
    controller `can` be asked to do."""

    axis: str
    position: str
    currents: tuple[str, ...]
    can: Capabilities

    @property
    def captured(self) -> tuple[str, ...]:
        """What is captured: the position as the law takes it, and the velocity."""
        return (self.position, VELOCITY)

    def choose(self, kind: str, name: str) -> dict[str, float]:
        """The parameters that choose a setting.

        Raises:
            Lacking: the controller has none of that name.
        """
        known = self.can.settings.get(kind, {})
        if name not in known:
            raise Lacking(f"capabilities.settings.{kind}: found no {name}; it has {', '.join(known) or 'none'}")
        return dict(known[name])

    def knows(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values of what the controller knows, by the parameter that each is bound to.

        Raises:
            Lacking: one is bound to none.
        """
        if missing := [meaning for meaning in values if meaning not in self.can.model]:
            raise Lacking(f"capabilities.model: found no {', '.join(missing)}")
        return {self.can.model[meaning]: value for meaning, value in values.items()}

    def known(self, rig: RigFile, meaning: str) -> float:
        """What the controller knows where a procedure writes nothing: the default of the parameter, SI."""
        return rig.parameters[next(iter(self.knows({meaning: 0.0})))].default


@once_per_rig
def conventions(rig: RigFile) -> OneAxis:
    """What the rig's machine calls its things: one radial bearing of one axis with two coils and a probe that looks along it.

    Raises:
        Lacking: the rig has other bearings, or the axis lacks what belongs to it.
    """
    axes = [axis for support in radial_supports(rig) for axis in support.axes]
    if len(axes) != 1:
        raise Lacking(f"bearings: found {len(axes)} radial axes; this procedure is for a machine of one")
    (axis,) = axes
    if not axis.position:
        raise Lacking(f"probes: found none that looks along {axis.name}")
    if len(axis.coils) != 2:
        raise Lacking(f"bearings.{axis.bearing}.axes.{axis.name}.coils: found {len(axis.coils)}; expected two")
    return OneAxis(axis.name, axis.position, axis.coils, rig.capabilities)
