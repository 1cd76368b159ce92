"""Drivers: from roles to bytes."""
