"""Levbench: the nouns and the engine. What comes in are bytes from a controller, what goes out is a record."""

__version__ = "0.1.0"
