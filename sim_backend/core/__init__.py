"""The C core: what its machines share, and how it is built."""

from sim_backend.core.plant import (
    LAND,
    LEVITATE,
    LIFT,
    OFF,
    PERIOD_TICKS,
    READY,
    TICK_S,
    TRIPS,
    Array,
    CorePlant,
    DriveLaw,
)

__all__ = [
    "LAND",
    "LEVITATE",
    "LIFT",
    "OFF",
    "PERIOD_TICKS",
    "READY",
    "TICK_S",
    "TRIPS",
    "Array",
    "CorePlant",
    "DriveLaw",
]
