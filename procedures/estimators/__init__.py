"""Estimators that procedures share: pure functions on arrays, no clock, no file, no random numbers."""
