"""Recordings: written while a run goes on, read back by `analyse` and reports."""

from bench.recording.captured import Captured
from bench.recording.recording import Recording
from bench.recording.steps import Step

__all__ = ["Captured", "Recording", "Step"]
