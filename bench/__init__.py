"""Levbench: the nouns and the engine. What comes in are bytes from a controller, what goes out is a record."""

from importlib.metadata import version

__version__ = version("levbench")
