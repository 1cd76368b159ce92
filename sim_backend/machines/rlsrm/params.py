"""Parameters of the rotary-linear switched reluctance motor's plant and of its controller, by the names of the core's structs.

R is Pan, Meng, Cao, IET Electr. Power Appl. 8 (2014) 199. It prints gap, mass, turns, arcs, resistance, encoders and gains;
map, inertia, friction, supply and limits are stand-ins, with where they come from. Pairs are (x, angle); six numbers are
phases A, B, C of stator 0, at -x, then of stator 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

Pair = tuple[float, float]
Each = tuple[float, ...]
PHASES = ("A1", "B1", "C1", "A2", "B2", "C2")
DEG = math.pi / 180


@dataclass(frozen=True)
class Map:
    """Inductances over angle, place and current; that of the machine, or what the controller takes for it.

    `slope` is mu_0 N^2 r arc/(2 gap): 150 turns, 40 degrees and 0.5 mm of R Table 1, a radius of 40 mm (stand-in: the mover has
    3.35 kg). `saturation` is the current of 1.6 T in the tooth tips, B 2 gap/(mu_0 N).
    """

    slope: float = 0.79  # H/m
    unaligned: float = 0.15  # of the aligned; stand-in
    c2: float = 0.0301  # of a triangle of 40 degrees at each side, in 90: tooth on tooth
    c3: float = 0.0859
    length: float = 28e-3  # m, of a stack; stand-in: both stators hold the mover over the 14 mm of R Table 2
    overlap: float = 14e-3  # m, at x = 0
    fringe: float = 1.5e-3  # m, three gaps; stand-in
    leakage: float = 1.5e-3  # H, stand-in
    saturation: float = 8.5  # A
    gain: Each = (1.0,) * 6
    zero: Pair = (0.0, 0.0)  # rad, of both stators against the encoder's zero
    centre: float = 0.0  # m, the magnetic one against the encoder's zero
    uneven: float = 0.0  # once per turn
    uneven_phase: float = 0.0  # rad


@dataclass(frozen=True)
class PlantParams:
    """Windings, mover, bearing, bumpers, encoders; each tolerance and each planted defect is a number here."""

    map: Map = field(default_factory=Map)
    mass: float = 3.35  # kg, R Table 1
    inertia: float = 1.5e-3  # kg m2; stand-in: 80 mm of iron of 40 mm radius, a shaft of 20 mm
    viscous: Pair = (4.0, 2e-3)  # N s/m, N m s/rad; stand-in
    coulomb: float = 1.5  # N along the path of the bearing's balls; stand-in, chosen for R's static errors
    coulomb_angle: float = 0.012  # N m, only where the axes rub apart
    bearing_radius: float = 8e-3  # m, stand-in
    along_path: float = 1.0  # 0: each axis rubs alone, for tests
    coulomb_sides: float = 0.0  # how much more of it towards +x, and less towards -x
    brake: Pair = (0.0, 0.0)  # N, N m: planted, a brake left on
    locked: Pair = (0.0, 0.0)  # 1: clamped
    push: Pair = (0.0, 0.0)  # N, N m from outside, along +x and +angle
    tilt: float = 0.0  # rad, +x downwards
    lock_give: Pair = (0.0, 0.0)  # m/N, rad/(N m): of what clamps
    cell_stiffness: Pair = (0.0, 0.0)  # N/m, N m/rad of load cells that hold it; 0: none do
    cell_damping: Pair = (0.0, 0.0)  # N s/m, N m s/rad
    cell_past: Pair = (1e-5, 1.2e-3)  # m, rad: how far they are wound past their place; stand-ins, as what follows
    cell_rate: Pair = (3.3e-5, 4e-3)  # m/s, rad/s
    hung: Pair = (0.0, 0.0)  # N, N m of weights, along +x and +angle
    hung_rate: Pair = (0.0, 0.0)  # N/s, N m/s by which they are let go
    added: Pair = (0.0, 0.0)  # kg, kg m2 of what hangs
    gravity: float = 9.81
    stop: float = 15e-3  # m, of the bumpers; stand-in: past it a stator has lost the mover
    stop_stiffness: float = 2e5
    stop_damping: float = 400.0
    resistance: Each = (7.8,) * 6  # ohm at 20 degrees, R Table 1
    ambient: float = 20.0  # degrees C
    copper: float = 0.00393  # 1/K
    thermal_resistance: float = 1.5  # K/W each phase, stand-in
    thermal_capacity: float = 60.0  # J/K, stand-in
    supply: float = 90.0  # V, stand-in
    share: Each = (1.0,) * 6  # of the supply that an amplifier can give: planted
    current_gain: Each = (1.0,) * 6
    current_offset: Each = (0.0,) * 6  # A
    wired: Each = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)  # which winding an amplifier drives: planted
    pitch: Pair = (1e-6, 0.144 * DEG)  # m and rad a count, R section 5; 0: reads what is
    edge: Pair = (0.0, 0.0)  # counts, where edges lie against the zero
    truncate: Pair = (0.0, 0.0)  # 1: the next lower count instead of the nearest
    scale: float = 0.0  # of the linear encoder
    once: float = 0.0  # rad, of the rotary one, once per turn
    once_phase: float = 0.0  # rad
    mark: Pair = (0.0, 0.0)  # counts from the zero: the encoders' marks, around once a turn
    substeps: float = 1.0  # of an amplifier's tick


@dataclass(frozen=True)
class ControlParams:
    """The controller: position loops at 1 kHz, distribution, what the amplifiers' loops are set to.

    R's own gains (Table 3) have no units and no reading under which all of its results come out; these are the design's.
    """

    map: Map = field(default_factory=Map)
    kp: Pair = (5400.0, 1.35)  # N/m, N m/rad
    ki: Pair = (5e4, 8.0)
    kd: Pair = (260.0, 0.09)
    cut: Pair = (60.0, 15.0)  # Hz: a count of the angle a millisecond is 2.5 rad/s
    limit: Pair = (9.0, 0.35)  # N, N m
    wait: float = 1.0  # integrators wait while a set point is sent; 2: in a sine, too; 0: never
    hold_at_limit: float = 1.0  # and while an axis does not get what it asks for
    speed: Pair = (0.0, 0.0)  # m/s, rad/s of set points; 0: at once
    rise: Pair = (0.3, 20.0)  # m/s2, rad/s2
    wave: Pair = (0.0, 0.0)  # 0 constant, 1 sine, 2 square
    amplitude: Pair = (0.0, 0.0)
    period: Pair = (5.0, 5.0)  # s
    phase: Pair = (0.0, 0.0)  # turns
    offset: Pair = (0.0, 0.0)  # and the constant
    pitch: Pair = (1e-6, 0.144 * DEG)
    rule: float = 0.0  # 0 any two of six phases, 1 one of each stator, 2 R's Table 2
    printed_index: float = 0.0  # 1: R (17), (18) with the index that is printed
    priority: float = 0.0  # where the current's limit takes something off: 0 off both axes, 1 off the angle, 2 off x
    hysteresis: float = 0.1  # share that the best pair must be cheaper by
    corrected: float = 1.0  # Table 2: its two misprinted cells
    by_force: float = 0.0  # its key is the sign of the force
    turned: float = 1.0  # its stator I is the one at +x
    clipped: float = 0.0  # a negative radicand is zero
    current_max: float = 6.0  # A, stand-in
    kp_i: float = 50.0  # V/A, stand-in
    ki_i: float = 4e4  # V/(A s)
    resistance: float = 7.8  # ohm, fed forward
    late: float = 2.0  # ticks from a reading to its currents' references
    home_current: Pair = (6.0, 4.0)  # A, along and around; stand-ins, as what follows
    home_s: Pair = (2.0, 0.5)  # of a step of homing
    home_rate: float = 0.05  # m/s, at most along
    safe_holds: float = 0.0  # after MAKE_SAFE 1: held, 0: without currents
    trip_A: float = 8.0
    trip_m: float = 14.5e-3
    trip_rate: Pair = (0.5, 60.0)  # m/s, rad/s, by the difference of two readings
    trip_warm: float = 120.0  # degrees C
    test_phase: float = 7.0  # in READY this phase alone carries `test_current`; beyond 5: none
    test_current: float = 0.0  # A
    current_zero: Each = (0.0,) * 6  # A that its loops take off what the amplifiers' sensors read
    watchdog_s: float = 0.08
