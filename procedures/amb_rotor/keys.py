"""Under which names numbers of the rig file go among the inputs of a model of the bearings."""

from __future__ import annotations

from procedures.amb_rotor.machine import AmbRotor


def number_key(identity: str) -> str:
    """Under which a number of the rig file's tables goes among the inputs."""
    return f"number {identity}"


def gap_key(machine: AmbRotor, axis: str) -> str:
    """Under which an axis' gap goes among the inputs: one that all share is "gap"."""
    shared = {t.identity for t in machine.stations.gaps.values()}
    return "gap" if len(shared) < 2 else number_key(machine.stations.gaps[axis].identity)
