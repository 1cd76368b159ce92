"""Campaigns: their file, directory and journal, and what they conclude."""

from bench.campaign.file import Campaign, Equation, Step, Virtual

__all__ = ["Campaign", "Equation", "Step", "Virtual"]
