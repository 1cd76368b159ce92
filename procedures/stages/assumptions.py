"""What no data of a positioned stage's procedures can show, with what it would do; as `procedures/shared/assumptions.py`."""

from __future__ import annotations

DECOUPLING = (
    "The scale of the controller's map beyond the plan's uncertainty of it: its newtons are what the cross force is told in, "
    "and 5 % of it are 5 %. Load cells or weights tell.",
    "Where the moved axis turns, both axes stick and no force is seen: the cross force there is in no result. The excursion "
    "has the whole period.",
    "A constant force on the held axis, by tilt or a cable, is none of the motion; nor is the mean of what the motion puts on "
    "it.",
    "Edges of counts and the encoder's zero: an excursion is from the set point as the encoder has it. Edges that lie half a "
    "count off put the true place off by as much, for good.",
    "Other motions: an excursion is that of this sine, about these places.",
)
LOAD_RESPONSE = (
    "An error that is common to all masses or to both arms, the same share of each, changes compliance and scale of the force "
    "by that share. One mass that is off by as little as the plan's max_apart lets pass changes them by up to two thirds of "
    "that.",
    "A pulley whose friction differs by its direction: half of the difference acts as a load that is as much less.",
    "Places other than the one where the axes stood: the force's scale is that of the map there.",
    "Deviations are those that the axis' own encoder reads; where its zero lies nothing here can show.",
)
POSITIONING = (
    "Where the instrument reads: an axis that tilts moves its ends by the tilt times how far they are off the line that is "
    "read, 10 µm for 100 µrad at 100 mm.",
    "The temperature: a scale of steel is 11.5 µm longer for each m and kelvin. Figures are those at the temperature of the "
    "run; nothing is brought to 20 °C.",
    "A zero of the instrument that is off throughout is in no figure: all of them are of differences. One that wanders faster "
    "than is stated shows only beyond the axis' own scatter; B_i changes by 0.1 µm for 1 nm/s and 100 s between the two ways.",
    "A gain of the instrument beyond its certificate, by alignment too, changes E, M and A by its share of the travel: 0.1 µm "
    "for 10 ppm of 10 mm.",
    "Another day, load or place: the next five approaches have a scatter of their own, whose s is this one within a factor of "
    "0.32 to 3.1 (95 %, five and five approaches).",
)
INDUCTANCE_MAP = (
    "Currents' readings that are all wrong by a share change slope and leakage by that share, saturation by its opposite; "
    "voltages' change slope and leakage. Phases that are alike show one that is off from the others, and no more.",
    "Iron that keeps a flux, or lags behind its current, in the same way at every place.",
    "Time is the controller's: a clock that is fast by 1e-4 makes fluxes smaller by that share.",
    "An encoder along that is off within its travel by more than its pitch: 1 µm at one place is 0.007 % of the overlap.",
)
STATIC_CHARACTERISTICS = (
    "A gain that both load cells have alike, or one of a cell and its arm that make up for each other: force and torque "
    "by that share. "
    "Only the map by flux stands against it.",
    "Currents' readings that are all wrong by a share change force and torque of a current by twice that share.",
    "Friction that is not alike from above and from below: half of the difference is taken for load, unless it is there "
    "without "
    "currents, too.",
    "An arm that is not at right angles to the cell: its cosine, 0.015 % for a degree.",
)
MAP_ZERO = (
    "Friction that differs by the way the shaft turns: a tenth more one way moves the zero by a tenth of the band.",
    "Inductance that grows to one side over the width of a tooth: the shaft comes to rest where it is greatest, and that is "
    "told.",
)
FOLLOWING = (
    "An encoder that has slipped, or whose zero was not found where it is, moves every true place by as much, and no reading. "
    "An error of an encoder beyond what the rig file states does so, too.",
    "An encoder that gives the next lower count in place of the nearest: all places are half a count farther than they read.",
    "Time is the controller's: a clock that is fast by 1e-4 makes times and lags shorter by that share.",
    "The machine as it is then: friction that changes by 10 % moves what is left without integrators by up to as much.",
)
AXIS_FRICTION = (
    "A weight that is not what its label says, or pulls the wrong way by both its pulleys: all friction by its share.",
    "Friction that is not alike everywhere: results are means over the windows of the passes.",
    "Friction that rises towards standstill (Stribeck): the line over the rates is told to no speed.",
    "A map of the controller whose error grows with the force by more than saturation: what a newton is under the load is "
    "taken for what it is without.",
    "Time is the controller's: a clock that is fast by 1e-4 makes viscous friction greater by that share.",
)
AXIS_BREAKAWAY = (
    "A weight that is not what its label says, or pulls the wrong way by both its pulleys: breakaway by its share.",
    "How long an axis has stood: friction that grows with rest is that of the plan's rest.",
    "Friction that is not alike everywhere: results are means over the places of the ramps.",
    "A shaft that creeps by less than a count before it breaks away.",
)
AXIS_INERTIA = (
    "A part that is not what its certificate says, or turns about another axis than the shaft: results by its share.",
    "Something beside the part that is put on with it, as screws: their share of the part.",
    "Friction that goes with the place: what is in phase with it there is taken for inertia.",
    "Time is the controller's: it is the same with and without the part, and falls out.",
)
