"""What the server serves: the hub's events, the page's files, answers, STOP, and the report when there is one."""

from __future__ import annotations

import secrets
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from bench.live.assets import Asset, page_assets
from bench.live.gate import new_token
from bench.live.hub import Hub
from bench.live.questions import Questions

READERS = 16  # pages that follow the events at once


@dataclass(kw_only=True)
class Served:
    """What any page is served with. `named` is a name by which the server was bound."""

    token: str = field(default_factory=new_token)
    cookie: str = field(default_factory=lambda: secrets.token_urlsafe(16))
    assets: Mapping[str, Asset] = field(default_factory=page_assets)
    named: str = ""

    def url(self, address: str, port: int) -> str:
        """What a person opens; the token is in the fragment, which no browser sends anywhere."""
        return f"http://{f'[{address}]' if ':' in address else address}:{port}/#{self.token}"

    @property
    def followed(self) -> int:
        """How many pages follow what happens."""
        return 0

    def close(self) -> None:
        """Let go whoever follows."""


@dataclass
class Site(Served):
    """Of one run. `stop` asks it to stop, with who asked; None where there is nothing to stop. `report` is the file of the
    report, once there is one; `fetched` how often it was asked for."""

    hub: Hub
    questions: Questions
    stop: Callable[[str], None] | None = None
    report: Path | None = None
    fetched: int = 0
    places: threading.BoundedSemaphore = field(default_factory=lambda: threading.BoundedSemaphore(READERS))

    @property
    def followed(self) -> int:
        return self.hub.readers

    def close(self) -> None:
        self.hub.close()
