"""The model that a campaign on one rig ends in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bench.campaign_directory import CampaignDirectory
from bench.cli.campaign_chain import Done

if TYPE_CHECKING:
    from bench.cli.campaign import Asked


def write(directory: CampaignDirectory, asked: Asked, done: Sequence[Done], report: bool) -> None:
    """`model.json`, and the summary if wanted."""
