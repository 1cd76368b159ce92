"""The true quantities of an AMB stand, by the measurands' definitions and not by what estimates them."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping

from sim_backend.machines.amb5dof import linear
from sim_backend.machines.amb5dof.params import AmbParams

RADIAL = ("yi", "zi", "yo", "zo")


def quantities(p: AmbParams, settings: Mapping[str, float]) -> dict[str, float]:
    """Per radial axis `beta_*` (N m^2/A^2) and `offset_*` (m, from the magnetic centre to where the sensors read zero);
    `unbalance_*` (kg m) and its phase from y towards z (rad) by balancing plane, `eccentricity` (m); `mode_*` (Hz);
    `frequency_*` (Hz) and `damping_*` of each law, linearised (`linear`) at the controller's `settings`."""
    out = {f"beta_{axis}": p.beta[k] for k, axis in enumerate(RADIAL)} | {"beta_x": p.beta[4]}
    out |= dict(zip((f"offset_{axis}" for axis in RADIAL), offsets(p), strict=True))
    whole = sum(cmath.rect(u, phase) for u, phase in zip(p.unbalance, p.unbalance_phase, strict=True))
    for b, u, phase in zip("io", p.unbalance, p.unbalance_phase, strict=True):
        out |= {f"unbalance_{b}": u, f"unbalance_phase_{b}": math.remainder(phase, 2 * math.pi)}
    out |= {"eccentricity": abs(whole) / p.mass, "mode_1": p.mode_hz[0], "mode_2": p.mode_hz[1]}
    for law in linear.LAWS:
        hz, damping = linear.slowest(p, settings, law)
        out |= {f"frequency_{law}": hz, f"damping_{law}": damping}
    return out


def offsets(p: AmbParams) -> tuple[float, float, float, float]:
    """Displacement of the shaft from each radial magnetic centre, yi zi yo zo, while every sensor reads zero."""
    zero = [-offset / gain for offset, gain in zip(p.position_offset, p.position_gain, strict=True)]
    span = p.l_is + p.l_os

    def at(plane: float, axis: int) -> float:
        return zero[axis] + (plane + p.l_is) / span * (zero[axis + 2] - zero[axis])

    yi, zi, yo, zo = p.offset
    return yi + at(-p.l_ia, 0), zi + at(-p.l_ia, 1), yo + at(p.l_oa, 0), zo + at(p.l_oa, 1)
