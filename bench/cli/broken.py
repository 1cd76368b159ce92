"""A rig file of which problems are told already: what a procedure or a machine trips over there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def forgiven(problems: object) -> Iterator[None]:
    """What is raised within is let go where there are `problems` already. A name that leads nowhere, or a unit that nobody
    knows, is looked up in a hundred places that rest on the check of the rig file; that check has named it, and what else is
    wrong is still to be listed. Without problems it is a mistake of ours, and comes out."""
    try:
        yield
    except Exception:
        if not problems:
            raise
