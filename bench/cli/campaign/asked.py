"""A campaign as it was asked for, and as it can be run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from bench.campaign import Campaign
from bench.cli.campaign.steps import Planned
from bench.cli.campaign.tasks import Keep
from bench.rigfile import RigFile


@dataclass(frozen=True)
class CampaignRequest:
    """A campaign as it was asked for; None leaves what the file says."""

    campaign: str
    jobs: int | None = None
    out: Path = Path("runs")
    rig: str | None = None
    backend: str | None = None
    seed: int | None = None
    visit: int | None = None
    count: int | None = None
    first_seed: int | None = None
    links: tuple[str, ...] = ()
    operator: str | None = None
    report: bool = True
    keep: Keep | None = None
    go_on: bool = False
    new: bool = False
    short: bool = False
    scheduler: str = ""


@dataclass(frozen=True)
class Asked:
    """A campaign that can be run."""

    request: CampaignRequest
    campaign: Campaign
    rig: RigFile
    steps: tuple[Planned, ...]
