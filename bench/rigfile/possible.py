"""What a rig file says twice, or what no sensor, mass or place can be: the redundancy that `bench check` looks at."""

from __future__ import annotations

import math
from collections.abc import Iterator

from bench.errors import Problem
from bench.rigfile.model import RigFile
from bench.rigfile.toleranced import Toleranced

GRAVITY_AGREES = 1e-3  # share: anomalies at the surface stay below 5e-4
GAIN = 0.05
ELEVATION_M = (-500.0, 9000.0)
AIR = (0.5, 1.5)  # kg/m^3: from 7000 m in summer to sea level in a hard winter
SOLID = (1500.0, 23000.0)  # kg/m^3: from light alloys with cavities to osmium
GAPS = ("amb_gap", "axial_gap", "clearance")
# Slips of three decades leave these, on machines of some centimetres and more.
GAP_M, LENGTH_M = (1e-6, 1e-2), (1e-4, 10.0)


def impossible(rig: RigFile) -> Iterator[Problem]:
    """Gravity against place and elevation, gains, densities and lengths against what there is."""
    yield from _site(rig)
    yield from _densities(rig)
    yield from _lengths(rig)
    for name, sensor in rig.sensors.items():
        yield from _gain(rig, f"sensors.{name}.gain", sensor.gain)


def normal_gravity(latitude_deg: float, elevation_m: float) -> float:
    """Gravity in m/s^2 at a latitude and height (IUGG 1967 in the form of OIML R 111: the formula of the rigs' files)."""
    s, s2 = math.sin(math.radians(latitude_deg)) ** 2, math.sin(2 * math.radians(latitude_deg)) ** 2
    return 9.780327 * (1 + 0.0053024 * s - 0.0000058 * s2) - 3.086e-6 * elevation_m


def _site(rig: RigFile) -> Iterator[Problem]:
    site, path = rig.site, str(rig.path)
    low, high = ELEVATION_M
    if not low <= site.elevation_m <= high:
        yield Problem(path, "site.elevation_m", f"{site.elevation_m:g} m", f"{low:g} to {high:g} m")
        return
    expected = normal_gravity(site.latitude_deg, site.elevation_m)
    if abs(site.gravity.value / expected - 1) > GRAVITY_AGREES:
        text = (f"within {GRAVITY_AGREES:.1%} of {expected:.5f} m/s^2, which latitude {site.latitude_deg:g} deg and elevation "
                f"{site.elevation_m:g} m give; is the latitude right?")  # fmt: skip
        yield Problem(path, "site.gravity.value", f"{site.gravity.value:g} m/s^2", text)


def _densities(rig: RigFile) -> Iterator[Problem]:
    path = str(rig.path)
    air, solid = rig.site.air_density.value, rig.mass_density.value
    if not AIR[0] <= air <= AIR[1]:
        yield Problem(path, "site.air_density.value", f"{air:g} kg/m^3", f"{AIR[0]:g} to {AIR[1]:g} kg/m^3")
    if rig.masses and not SOLID[0] <= solid <= SOLID[1]:
        yield Problem(path, "mass_density.value", f"{solid:g} kg/m^3",
                      f"{SOLID[0]:g} to {SOLID[1]:g} kg/m^3: the density of the masses, not of the air")  # fmt: skip


def _lengths(rig: RigFile) -> Iterator[Problem]:
    """A length in the wrong unit; what is not positive is another matter."""
    for name, length in rig.geometry.items():
        if beyond := beyond_likely(name, length):
            text = f"{beyond[0]:g} to {beyond[1]:g} m; is the unit right?"
            yield Problem(str(rig.path), f"geometry.{name}.value", f"{length.value:g} m", text)


def beyond_likely(name: str, length: Toleranced) -> tuple[float, float] | None:
    """The range that a length of [geometry] of this name is beyond; None where it is within it."""
    low, high = GAP_M if name in GAPS else LENGTH_M
    return (low, high) if length.unit == "m" and length.value > 0 and not low <= length.value <= high else None


def _gain(rig: RigFile, key: str, gain: Toleranced) -> Iterator[Problem]:
    """A gain is what a sensor reads over what is there. One that is far from 1 is a slip of the pen, a scale that belongs in
    the DBC, or a sensor to be repaired; what it may be within that is a certificate's matter."""
    if abs(gain.value - 1) > GAIN:
        yield Problem(str(rig.path), f"{key}.value", f"{gain.value:g}",
                      f"1 within {GAIN:.0%}, readings over true values; a scale belongs in the DBC")  # fmt: skip
