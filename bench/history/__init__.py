"""Runs over time: what the index keeps of them, compared and followed."""
