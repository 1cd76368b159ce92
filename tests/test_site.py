"""What the documentation's site is built from: pages as they are, and a gallery of what campaigns left."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs/site"))
import collect_pages  # noqa: E402


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A campaign's directory with one run."""
    found = tmp_path / "chain.campaign-20260101T000000Z-abcd/runs/spindown-20260101T000000Z-1234"
    found.mkdir(parents=True)
    (found / "report.html").write_text("<p>report</p>")
    (found / "record.json").write_text(json.dumps({"procedure": "spindown", "rig": "tsbs12", "outcome": "PASS"}))
    return found


def test_pages_are_as_they_are_and_their_links_hold(tmp_path: Path, run: Path) -> None:
    site = tmp_path / "pages"
    (site / "old.md").parent.mkdir()
    (site / "old.md").touch()
    collect_pages.collect(site, [run.parents[1]])
    assert not (site / "old.md").exists()
    for page in collect_pages.pages():
        assert (site / page.relative_to(ROOT)).read_bytes() == page.read_bytes()
    for page in site.rglob("*.md"):
        for target in re.findall(r"\]\(([^)#:\s]+)[)#]", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.relative_to(site)}: {target}"
    config = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert all((site / name).exists() for name in re.findall(r": (\S+\.md)$", config, re.MULTILINE))


def test_the_gallery_shows_reports_with_their_outcomes(tmp_path: Path, run: Path) -> None:
    site = tmp_path / "pages"
    collect_pages.collect(site, [run.parents[1]])
    gallery = (site / "gallery/README.md").read_text(encoding="utf-8")
    ((name, rig, outcome),) = re.findall(r"^\| \[spindown\]\((\S+)\) \| (\S+) \| (\S+) \|$", gallery, re.MULTILINE)
    assert (rig, outcome) == ("tsbs12", "PASS")
    assert (site / "gallery" / name).read_bytes() == (run / "report.html").read_bytes()


def test_tools_are_pinned() -> None:
    lines = (ROOT / "docs/site/tools.txt").read_text(encoding="utf-8").splitlines()
    assert all(re.fullmatch(r"[\w-]+==[\w.]+", line) for line in lines if not line.startswith("#"))
