"""The pages of `bench show` on runs that are over: list, run, report, trend, at the width of a desk and of a phone. Pictures to
look at are under `build/browser/`."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
import real
from test_states import FITS, SHOTS

Open = Callable[..., Any]
SHORT = ("--plan", "angles=1", "--plan", "settle_s=0.3", "--plan", "average_s=0.2")
VALUES = (75.00, 75.02, 74.97, 75.01, 74.99, 75.03, 74.98, 75.01, 75.05, 75.12, 75.19, 75.26)
pytestmark = pytest.mark.timeout(300)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with its report as the newest; before it records of the same one with other days and values, as a real machine's,
    and of its twin, served."""
    root = tmp_path_factory.mktemp("runs")
    made = real.finished(root, "amb-calibration", "--rig", "tsbs12", "--visit", "1", *SHORT)
    record = json.loads((made / "record.json").read_text(encoding="utf-8"))
    for k, value in enumerate(VALUES):
        for hours, served in ((0, False), (1, True)):
            at = datetime(2026, 1, 5, 8 + hours, tzinfo=UTC) + timedelta(days=7 * k)
            path = root / f"amb-calibration-{at:%Y%m%dT%H%M%SZ}-{k:04x}"
            path.mkdir()
            own = dict(record, run_id=path.name, started=at.isoformat(), ended=at.isoformat(), seed=None, visit=None)
            own["findings"] = [
                {"code": "simulated-controller", "text": "it says so", "where": "controller", "effect": "note"}
            ] * served
            own["measurements"] = [
                m | ({"value": value + hours} if m["name"] == "K_i" else {}) for m in record["measurements"]
            ]
            (path / "record.json").write_text(json.dumps(own), encoding="utf-8")
    shutil.copy(made / "report.html", root / "amb-calibration-20260323T080000Z-000b" / "report.html")
    (root / "index.sqlite").unlink()  # it knows of the run alone
    return root


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    with real.shown(folder) as address:
        yield address


@pytest.fixture(params=[(1200, 900), (400, 800)], ids=["1200", "400"])
def seen(request: pytest.FixtureRequest, address: str, opened: Open) -> Iterator[Any]:
    """The page; whatever was done on it, nothing was asked of anybody else, and it complained of nothing."""
    width, height = request.param
    found = opened(address, width=width, height=height)
    yield found
    assert {urlsplit(url).netloc for url in found.asked} == {urlsplit(address).netloc}
    assert urlsplit(address).hostname == "127.0.0.1"
    assert found.wrong == []


def keep(page: Any, name: str) -> None:
    """A picture; nothing is wider than the window."""
    assert page.evaluate(FITS)
    SHOTS.mkdir(parents=True, exist_ok=True)
    (SHOTS / f"show-{name}-{page.viewport_size['width']}.png").write_bytes(page.screenshot(full_page=True))


def test_what_is_tried_is_what_was_asked_for() -> None:
    assert real.owned_by().is_relative_to(real.INSTALLED or real.ROOT)


def test_the_list_and_its_filter(seen: Any, expect: Any) -> None:
    page = seen.page
    expect(page.locator("#runs tbody tr")).to_have_count(2 * len(VALUES) + 1)
    keep(page, "list")
    page.fill("#words", "real")
    expect(page.locator("#count")).to_have_text(f"{len(VALUES)} of {2 * len(VALUES) + 1} runs")
    page.fill("#words", "nothing of this kind")
    expect(page.locator("#runs tbody tr")).to_have_count(0)


def test_a_run_with_its_report(seen: Any, expect: Any) -> None:
    page = seen.page
    page.locator("#runs tbody a").first.click()
    expect(page.locator("#outcome")).to_have_text("PASS")
    assert "K_i" in page.locator("#results tbody").inner_text()
    report = page.frame_locator("#frame")
    expect(report.locator(".outcome strong")).to_have_text("PASS")
    keep(page, "run")
    with page.expect_popup() as popup:
        page.click("#reportlink")
    expect(popup.value.locator(".outcome strong")).to_have_text("PASS")
    keep(popup.value, "report")
    page.go_back()
    expect(page.locator("#list")).to_be_visible()


def test_a_trend_of_the_real_machine_and_of_its_twin(seen: Any, expect: Any) -> None:
    page = seen.page
    page.fill("#words", "real")
    expect(page.locator("#runs tbody tr")).to_have_count(len(VALUES))
    page.locator("#runs tbody a").first.click()
    page.locator("#results tbody a", has_text="K_i").first.click()
    expect(page.locator("#machine")).to_have_value("real")
    expect(page.locator("#table")).to_contain_text(f"{len(VALUES)} runs, 2026-01-05 08:00 to 2026-03-23 08:00")
    assert page.locator("#drawing").evaluate("(image) => image.decode().then(() => image.naturalWidth)") > 0
    expect(page.locator("#table")).to_contain_text("above its limits first in run")
    keep(page, "trend")
    page.select_option("#machine", "served")
    page.click("#ask button")
    expect(page.locator("#which")).to_contain_text("served simulation")
    page.select_option("#machine", "simulated")
    page.click("#ask button")
    expect(page.locator("#wrong")).to_contain_text("found 1 run with a value")
    refused = seen.wrong.pop()  # the browser's own line on what was refused
    assert "400" in refused
