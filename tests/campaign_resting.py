"""The small procedure at rest, as a module of its own."""

from tests.tiny_procedures import resting as procedure

__all__ = ["procedure"]
