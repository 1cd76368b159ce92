"""What an AMB rotor's stand calls its things: axes, planes, channels, status bits, laws and parameters.

A procedure asks for them once, `machine = conventions(rig)`, and hands them on. AMB_ROTOR is for declarations without a rig.
"""

from __future__ import annotations

import math
from dataclasses import replace

from bench.rigfile import RigFile
from bench.rigfile.capabilities import Capabilities
from bench.rigfile.recorded import pulsed, recorded
from bench.rigfile.roles import ANGLE, SPEED, Status, is_bound
from bench.rigfile.supports import axial_support, least_clearance, once_per_rig, two_planes
from procedures.amb_rotor import loops
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.stations import gaps, in_two_planes, stations
from procedures.shared.unsupported import contradicted, crooked, of_weight

_AXES = ("yi", "zi", "yo", "zo", "x")
AMB_ROTOR = AmbRotor(
    axes=("yi", "zi", "yo", "zo"),
    axial="x",
    planes={"inboard": (0, 1), "outboard": (2, 3)},
    rings={"inboard": Status.CONTACT_NEAR, "outboard": Status.CONTACT_FAR},
    probes={axis: f"pos_{axis}" for axis in _AXES},
    pulls={axis: (f"i_{axis}_p", f"i_{axis}_n") for axis in _AXES},
    coil_voltages={axis: (f"u_{axis}_p", f"u_{axis}_n") for axis in _AXES},
    plane_voltages=("u_i", "u_o"),
    axial_stop=Status.CONTACT_AXIAL,
    current_limit=Status.CURRENT_LIMIT,
    voltage_limit=Status.VOLTAGE_LIMIT,
    sensor_range=Status.SENSOR_RANGE,
    can=Capabilities(),
    stations=in_two_planes(_AXES[:4], -0.097, 0.081),
    stands_s=1.0,  # it knows half a second after the last pulse
    lag_s=1 / (800 * math.pi),
    loop_rad_s=math.inf,
    gaps={},
    speed_told=True,
    marked=True,
    clearance=1e-4,
)
"""The AMB stand of the thesis, rigs/amb5dof.dbc."""


@once_per_rig
def conventions(rig: RigFile) -> AmbRotor:
    """What the rig's machine calls its things: two radial bearings, from the near end to the far one, and an axial one.

    Raises:
        Lacking: the rig has other bearings, or one of them without what belongs to an axis.
    """
    planes, axial = two_planes(rig, probed=False), axial_support(rig)
    axes = [axis for plane in planes for axis in plane.axes]
    everywhere = [*axes, *([axial] if axial is not None else [])]
    told = tuple(plane.voltage for plane in planes)
    lean = rig.machine["radial_axes"].value if "radial_axes" in rig.machine else math.pi / 4
    return replace(
        AMB_ROTOR,
        axes=(axes[0].name, axes[1].name, axes[2].name, axes[3].name),
        axial=axial.name if axial is not None else "",
        planes={plane.name: (2 * k, 2 * k + 1) for k, plane in enumerate(planes)},
        rings=dict(zip((plane.name for plane in planes), AMB_ROTOR.rings.values(), strict=True)),
        probes={axis.name: axis.position for axis in everywhere if axis.position},
        pulls={axis.name: (axis.coils[0], axis.coils[1]) for axis in everywhere if len(axis.coils) == 2},
        coil_voltages={a.name: (a.voltages[0], a.voltages[1]) for a in everywhere if recorded(rig, a.voltages) == 2},
        plane_voltages=told if all(told) else (),
        can=rig.capabilities,
        stations=stations(rig),
        lag_s=loops.lag_s(rig),
        loop_rad_s=loops.loop_rad_s(rig),
        gaps=gaps(rig),
        lacks=tuple(contradicted(rig, planes)),
        crooked=crooked(rig, planes),
        unweighed=of_weight(rig, planes, (-lean, math.pi / 2 - lean)),
        speed_told=is_bound(rig, SPEED),
        marked=is_bound(rig, ANGLE) and is_bound(rig, SPEED),
        clearance=least_clearance(rig),
        pulsed=pulsed(rig),
    )
