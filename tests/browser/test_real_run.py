"""The live page of real runs: questions answered at the page, STOP, how old the data are, the report at the end."""

from __future__ import annotations

import fcntl
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
import real
from test_page import COUNTED, told_of

Open = Callable[..., Any]
LOCK = Path("/tmp/levbench-locks/live")
pytestmark = pytest.mark.timeout(300)


@pytest.fixture
def alone() -> Iterator[None]:
    """One run in real time on a machine: two disturb each other's links."""
    LOCK.parent.mkdir(exist_ok=True)
    with open(LOCK, "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def test_a_person_at_the_page_answers_and_stops_a_served_run(
    tmp_path: Path, alone: None, opened: Open, expect: Any, figure: Callable[[str], None]
) -> None:
    with (
        real.served("tsbs12") as links,
        real.run(tmp_path, "amb-calibration", "--rig", "tsbs12", "--operator", "console", *links) as run,
    ):
        page = opened(run.address, script=COUNTED).page
        page.fill("#who", "Ann")
        for asks in ("Hang M4", "Take every mass off"):
            expect(page.locator("#question")).to_contain_text(asks, timeout=30_000)
            page.locator("#choices button").first.click()
            expect(page.locator("#answered")).to_have_text("Answered: done (page: Ann).")
        expect(page.locator("#step")).to_contain_text("hang")
        page.wait_for_timeout(8000)
        group = page.evaluate("window.drawn.slice(-150)")
        page.set_viewport_size({"width": 1200, "height": 3400})
        page.get_by_role("tab", name="All").click()
        page.wait_for_timeout(2000)
        page.evaluate("window.drawn.length = 0")
        page.wait_for_timeout(8000)
        frames = page.evaluate("window.drawn")
        channels = page.locator(".legend li").count()
        if page.locator("#prompt").is_visible():
            page.locator("#choices button").first.click()
            expect(page.locator("#prompt")).to_be_hidden()
        page.click("#stop")
        expect(page.locator("#outcome")).to_have_text("ABORTED", timeout=30_000)
        expect(page.locator("#reason")).to_contain_text("exit status 4")
        page.close()
        status, record = run.end()
    assert status == 4
    assert record["outcome"] == "ABORTED"
    (found,) = [f for f in record["findings"] if f["code"] == "operator-stop"]
    assert "Ann" in found["text"]
    assert "make-safe-failed" not in {f["code"] for f in record["findings"]}
    figure(f"served run, inboard group at 1200 x 900: {told_of(group)}")
    figure(f"served run, all {channels} channels in one window of 1200 x 3400: {told_of(frames)}")


def test_a_simulated_run_to_its_report(tmp_path: Path, opened: Open, expect: Any) -> None:
    with real.run(tmp_path, "amb-calibration", "--rig", "tsbs12", "--seed", "1") as run:
        found = opened(run.address)
        page = found.page
        expect(page.locator("#simulated")).to_be_visible(timeout=30_000)
        expect(page.locator("#outcome")).to_have_text("PASS", timeout=120_000)
        rows = [row.split() for row in page.locator("#results tbody tr").all_inner_texts()]
        with page.expect_popup() as popup:
            page.click("#reportlink")
        expect(popup.value.locator(".outcome strong")).to_have_text("PASS")
        report = popup.value.locator("table").first.inner_text()
        with page.expect_download() as download:
            page.click("#reportsave")
        kept = download.value.path().read_text(encoding="utf-8")
        popup.value.close()
        page.close()
        status, record = run.end()
    assert status == 0
    assert kept == (record["folder"] / "report.html").read_text(encoding="utf-8")
    assert len(rows) == len([m for m in record["measurements"] if m["value"] is not None])
    assert any(row[-4] in report for row in rows)  # the same digits as on page 1
    assert found.wrong == []
    asked = [urlsplit(url) for url in found.asked]
    assert {url.netloc for url in asked if url.scheme != "blob"} == {urlsplit(run.address).netloc}
