"""The AMB stand of the thesis, as its rig file has it: names for tests of estimators that have no rig."""

from __future__ import annotations

from bench.rigfile import load_rig
from procedures.amb_rotor.conventions import conventions

AMB_ROTOR = conventions(load_rig("amb5dof"))
