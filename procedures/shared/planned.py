"""What plans choose of a controller by the names of the rig file: an observer, values of parameters."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from bench.rigfile import RigFile

OBSERVER = "observer"


def observer(rig: RigFile, name: str) -> dict[str, float]:
    """Parameters that choose it, with their values; none where the rig file has no choice."""
    return dict(rig.capabilities.settings.get(OBSERVER, {}).get(name, {}))


def of_observer(rig: RigFile, name: str) -> Iterator[str]:
    """What is wrong with a plan's observer; a controller that has no choice takes any name."""
    known = rig.capabilities.settings.get(OBSERVER, {})
    if known and name not in known:
        yield f"observer: found {name!r}; expected one of {', '.join(known)}"


def of_parameters(rig: RigFile, names: Iterable[str]) -> Iterator[str]:
    """What is wrong with the parameters that a plan writes."""
    if unknown := [name for name in names if name not in rig.parameters]:
        yield f"parameters: found {', '.join(unknown)}; expected parameters of this rig"
