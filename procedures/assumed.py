"""What is in no budget and no data of any size can show, by procedure: sentences for the report, each with its sensitivity."""

from __future__ import annotations

AMB_CALIBRATION = (
    "An error that is common to all masses, the same share of each, changes K, K2 and Kw by that share.",
    "Errors of the masses that go with the square of the load change K2 by K² over the bearing's force per kg, for each kg "
    "per kg². Masses of 1, 2 and 3 kg off by 0.2, 0.4 and 0.6 % leave the data that one of 0.5 kg off by -0.1 % leaves.",
    "A hanger that is off throughout changes F0, and Kw by 2 K2/Kw for each N that it weighs at the bearing.",
)
TORQUE_CONSTANT = (
    "An error that is common to all masses or to both arms, the same share of each, changes alpha_tau by that share.",
    "A lever that is not level by 1° takes 0.015 % off every torque, and off alpha_tau.",
)
SPINDOWN = (
    "A constant torque that acts against either direction alike, such as a seal or a brake that drags whatever turns the "
    "rotor, is in T_c with its whole amount.",
    "With the ring an error of its inertia changes J_z, B and T_c by its share, until J_z leaves the drawing's tolerance.",
)
FORCE_CONSTANT = (
    "An asymmetry K_x/K_y that is common to both AMBs changes alpha_dx by the same share: both rows move together.",
)
FORCE_COUPLING = (
    "A controller that turns its currents by 1.02 times the phase angle changes gamma_0 and alpha_c by 2 %, and the model "
    "fits nearly as well.",
)
UNBALANCE = (
    "Runout that changes with speed (a shaft that grows, probes that see its material) is in the vectors, half axes and D_max "
    "with its whole amount: the slow roll sees it at its own speed only.",
    "Motion that turns with the shaft at order 4 or above is taken for runout: D_max may lack its whole amount.",
)
BALANCE = (
    "Both trial weights at the same wrong angle turn the unbalance by it: corrections by that scale are right all the same.",
    "A laboratory balance that weighs every weight wrong by one share changes the unbalance by that share; corrections that "
    "are weighed on it are right all the same.",
    "Runout that changes with speed reads as unbalance: 2 µm at 10 000 r/min as some 1 g mm, as found and as left.",
)
