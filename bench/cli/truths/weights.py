"""Truths of the constants that weights tell."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bench.cli.truths.settings import Found

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def constants(done: Simulated) -> Found:
    """K_B of each plane is the machine's; of both together 1/(f_1/K_1 + f_2/K_2), shares f of a weight by levers."""
    from procedures.bearing_constant.stand import hooks, planes, set_points

    plan: Any = done.recording.plan
    rig, drawn = done.recording.rig, done.drawn.values
    two, motion = planes(rig), rig.capabilities.motion
    k = [done.truth[name] for plane in two if (name := f"K_B@{plane.motor}") in done.truth]
    if motion is None or len(k) < 2:
        return
    if len(hooks(rig, plan)) == 2:
        for plane, value in zip(two, k, strict=True):
            yield "K_B", plane.motor, value
    half = drawn["geometry.bearing_plane"]
    for hook in hooks(rig, plan):
        stated = str(rig.hooks[hook].at)
        at = drawn[stated.removeprefix("-").replace("/", ".")] * (-1 if stated.startswith("-") else 1)
        share = 0.5 + (at + set_points(rig, plan)[motion.place] - drawn["middle"]) / (2 * half)
        yield "K_mean", hook, 1 / (share / k[0] + (1 - share) / k[1])
