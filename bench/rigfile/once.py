"""What is made of a rig file once, however often it is asked for."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from functools import wraps
from typing import TypeVar

R = TypeVar("R")
T = TypeVar("T")


def once_per_rig(make: Callable[[R], T]) -> Callable[[R], T]:
    """A function of a rig file that is called time and again with the same one."""
    known: dict[int, tuple[weakref.ref[R], T]] = {}

    @wraps(make)
    def remembered(rig: R) -> T:
        found = known.get(id(rig))
        if found is None or found[0]() is not rig:
            found = known[id(rig)] = (weakref.ref(rig, lambda _, key=id(rig): known.pop(key, None)), make(rig))  # type: ignore[misc]
        return found[1]

    return remembered
