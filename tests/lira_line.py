"""A bench connected to a lira that runs elsewhere, by its command line."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator

from bench.cli.opening import LIVE_SLICE_S, beat_of
from bench.clock import WallClock
from bench.link.session import new_session
from bench.rigfile import RigFile, load_rig
from drivers.controller import Controller
from drivers.live_link import LiveLink
from drivers.wires import open_wire


@contextlib.contextmanager
def connected(text: str, url: str) -> Iterator[Controller]:
    """By a rig file's `text`, on the link `url`."""
    rig = RigFile.parse(re.sub(r'url = "cli:.*"', f'url = "{url}"', text), load_rig("lira").dbc_text)
    wall, session = WallClock(), new_session()
    link = LiveLink(
        "controller", lambda: open_wire(rig.link, "controller", (), wall.now_ns, rig), beat_of(rig, session)
    )
    with contextlib.closing(link):
        controller = Controller(rig, link, wall, session, LIVE_SLICE_S)
        controller.connect()
        yield controller
