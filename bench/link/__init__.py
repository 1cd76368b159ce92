"""Links: frames, and what is made of them."""

from bench.link.link import Link, LinkStats

__all__ = ["Link", "LinkStats"]
