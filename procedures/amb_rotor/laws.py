"""Laws and settings that a plan names: are they the controller's?"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from procedures.amb_rotor.machine import AmbRotor


def of_laws(machine: AmbRotor, key: str, laws: Iterable[str]) -> Iterator[str]:
    """Laws of a plan's `key` that the controller does not have; "" is always one: as it is set."""
    known = ", ".join(machine.laws) or 'none to choose from; leave it out, or ""'
    for law in laws:
        if law and law not in machine.laws:
            yield f"{key}: found {law}; the controller has {known}"


def of_variants(machine: AmbRotor, key: str, variants: Iterable[str]) -> Iterator[str]:
    """Ways of compensating of a plan's `key` that the controller does not have."""
    for variant in variants:
        if variant not in machine.variants:
            yield f"{key}: found {variant}; the controller has {', '.join(machine.variants)}"
