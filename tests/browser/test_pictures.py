"""The README's pictures: the live page while a shaft turns, and the report of that run. `make pictures` puts them into
`docs/pictures/`; without PICTURES they go where those of the states are."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import real
from PIL import Image
from test_states import SHOTS

FOLDER = Path(os.environ["PICTURES"]) if os.environ.get("PICTURES") else SHOTS
WIDTH, HEIGHT = 1200, 860
LARGEST = 60_000  # bytes: they are part of the repository
COMMON, OTHERS = 32, 64  # colours: surfaces and text as they are, the rest as near as it goes


def keep(name: str, shot: bytes) -> None:
    """As a small file."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    full = Image.open(io.BytesIO(shot)).convert("RGB")
    counted = sorted(full.getcolors(full.width * full.height), reverse=True)
    common = [part for _, colour in counted[:COMMON] for part in colour]
    others = full.quantize(OTHERS, Image.Quantize.MAXCOVERAGE).getpalette()
    palette = Image.new("P", (1, 1))
    palette.putpalette(common + others[: 3 * OTHERS])
    full.quantize(palette=palette, dither=Image.Dither.NONE).save(FOLDER / name, optimize=True)
    assert (FOLDER / name).stat().st_size < LARGEST


LONG_DWELL = ("--plan", "dwell_s=300")  # a picture of a shaft that turns, and of nothing that ends meanwhile


@pytest.mark.timeout(300)
def test_the_picture_of_the_live_page(tmp_path: Path, opened: Callable[..., Any], expect: Any) -> None:
    with real.run(tmp_path, "unbalance", "--rig", "amb5dof", "--no-report", *LONG_DWELL) as run:
        page = opened(run.address, width=WIDTH, height=HEIGHT).page
        expect(page.locator("#step")).to_contain_text("dwell speed 4000 r/min", timeout=120_000)
        page.wait_for_timeout(2500)
        keep("live-page.png", page.screenshot())
        page.close()


@pytest.mark.timeout(300)
def test_the_picture_of_a_report(tmp_path: Path, opened: Callable[..., Any], expect: Any) -> None:
    with real.run(tmp_path, "amb-calibration", "--rig", "tsbs12", "--seed", "1") as run:
        page = opened(run.address, width=WIDTH, height=HEIGHT).page
        expect(page.locator("#outcome")).to_have_text("PASS", timeout=180_000)
        with page.expect_popup() as popup:
            page.click("#reportlink")
        popup.value.set_viewport_size({"width": WIDTH, "height": HEIGHT})
        popup.value.wait_for_load_state()
        keep("report.png", popup.value.screenshot())
        popup.value.close()
        page.close()
        assert run.end()[0] == 0
