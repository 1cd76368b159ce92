"""Spectra, orders, orbits and frequency responses: pure functions of sampled data, and frozen types for what they find.

Conventions, stated here once. Time in s, angle in rad, speed in rad/s, displacement in m, unbalance in kg m.

The shaft's angle theta is 0 where the once-per-turn mark passes its pickup and grows by 2 pi in a turn, whatever the
direction of rotation. A vibration of order n is x = Re(X exp(j n theta)), X its vector: abs(X) is the amplitude, zero to
peak, and -arg(X) the phase lag: by so much of n theta the positive peak comes after the mark. At n = 1 that is the angle by
which the shaft turns from the mark at its pickup to the high spot at the probe.

Probes x and y are in that order in the direction of rotation (y's probe is a quarter turn after x's) unless a function is
told otherwise; z = x + i y then turns forward with exp(+j theta). Data of several channels are (channels, samples).
"""
