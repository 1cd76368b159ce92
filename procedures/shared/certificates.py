"""From the rig file's certificates to estimates with influences, so that every use of a certificate shares one."""

from __future__ import annotations

from collections.abc import Mapping

from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import Estimate, Influence

WORDS = {"com": "centre of mass", "amb": "AMB"}


def spelled(key: str) -> str:
    """A key of the rig file in words: `com_to_outboard_amb` is "centre of mass to outboard AMB"."""
    return " ".join(WORDS.get(part, part) for part in key.split("_"))


def certified(identity: str, t: Toleranced, name: str = "") -> Estimate:
    """The certified value as an Estimate with one Type B influence known by `identity` (stable along the chain); `name` is what
    a budget calls it, else the last part of its identity in words."""
    influence = Influence(
        id=identity,
        name=name or spelled(identity.rpartition("/")[2]),
        u=t.standard_uncertainty,
        unit=t.unit,
        kind="B",
        distribution=t.distribution,
        source=t.source,
    )
    return Estimate.of(t.value, influence)


def share_of(identity: str, t: Toleranced, name: str = "") -> Estimate:
    """1 with how far the certified number may be off, as a share of it: by the same influence as `certified` has, in the
    number's own unit, so that a scale and a length by it meet as one."""
    return Estimate(1.0, "1", {i: 1 / t.value for i in certified(identity, t, name).sensitivities if i.u > 0})


def certified_gain(rig: RigFile, channel: str) -> Estimate:
    """Gain of a channel's sensor."""
    return certified(f"sensors/{channel}/gain", rig.sensors[channel].gain, f"gain of {channel}")


def certified_sensors(rig: RigFile, channels: Mapping[str, str]) -> dict[str, Estimate]:
    """`gain_<key>` and `offset_<key>` of each of the channels' sensors, by key."""
    out = {}
    for key, channel in channels.items():
        out[f"gain_{key}"] = certified_gain(rig, channel)
        out[f"offset_{key}"] = certified(
            f"sensors/{channel}/offset", rig.sensors[channel].offset, f"offset of {channel}"
        )
    return out
