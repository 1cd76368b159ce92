"""The truths of motion of a rig's twin, as procedures' plans ask for them."""

from __future__ import annotations

from sim_backend.machines.twin import truth_step
from sim_backend.motion import Motions

MOTIONS = Motions(steps=truth_step.steps_asked)
