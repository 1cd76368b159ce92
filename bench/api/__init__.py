"""Stored runs for scripts and notebooks. Users come through `bench.open_run` and `bench.runs`."""
