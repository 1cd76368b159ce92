"""What was made last is kept, as it may be wanted again: so many things, and together so many bytes."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from typing import Generic, TypeVar

V = TypeVar("V")


class Kept(Generic[V]):
    """The values of the keys that were asked for last, at most `count` of them and `size` bytes together."""

    def __init__(self, count: int, size: int) -> None:
        self._count, self._size, self._total = count, size, 0
        self._items: OrderedDict[Hashable, tuple[V, int]] = OrderedDict()

    def get(self, key: Hashable) -> V | None:
        """The value, if it is still there."""
        found = self._items.get(key)
        if found is None:
            return None
        self._items.move_to_end(key)
        return found[0]

    def put(self, key: Hashable, value: V, size: int) -> None:
        """Keep a value that takes `size` bytes; the oldest go where it does not fit beside them."""
        self._total += size - self._items.pop(key, (value, 0))[1]
        self._items[key] = (value, size)
        while self._items and (self._total > self._size or len(self._items) > self._count):
            self._total -= self._items.popitem(last=False)[1][1]

    def clear(self) -> None:
        """Forget all."""
        self._items.clear()
        self._total = 0
