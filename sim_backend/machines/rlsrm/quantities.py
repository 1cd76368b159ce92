"""True quantities of the rotary-linear motor that do not go with a plan."""

from __future__ import annotations

from sim_backend.machines.rlsrm.params import PHASES, PlantParams


def quantities(p: PlantParams) -> dict[str, float]:
    """By kind and place: mass, inertia, friction, zeros and centre of the map, its numbers, resistances at 20 degC."""
    m = p.map
    return {
        "m": p.mass, "J": p.inertia, "F_c": p.coulomb, "T_c": p.coulomb * p.bearing_radius, "D": p.viscous[0],
        "K": p.viscous[1], "r_b": p.bearing_radius, "zero@stator1": m.zero[0], "zero@stator2": m.zero[1], "x_0": m.centre,
        "lambda": m.slope, "k_u": m.unaligned, "c_2": m.c2, "c_3": m.c3, "l": m.length, "o_0": m.overlap, "w": m.fringe,
        "L_l": m.leakage, "i_s": m.saturation,
        **{f"gain@{name}": gain for name, gain in zip(PHASES, m.gain, strict=True)},
        **{f"R@{name}": ohm for name, ohm in zip(PHASES, p.resistance, strict=True)},
    }  # fmt: skip
