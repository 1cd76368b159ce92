"""Collects what the documentation's site is built from: `python docs/site/collect_pages.py FOLDER [CAMPAIGN...]`.

Pages and what they link to are copied to where they lie in the clone, so that their links hold; lists are made of folders that
have none, and a gallery of the reports in the directories of campaigns.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"\]\(([^)#:\s]+)[)#]")
TITLE = re.compile(r"^# (.*)$", re.MULTILINE)


def pages(root: Path = ROOT) -> list[Path]:
    """The pages of the documentation: those of the clone's own folder, of `docs` and of `examples`."""
    return sorted([*root.glob("*.md"), *root.glob("docs/**/*.md"), *root.glob("examples/**/*.md")])


def linked(page: Path, root: Path = ROOT) -> Iterator[Path]:
    """The files of the clone that a page links to, pages left out."""
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        path = (page.parent / target).resolve()
        if path.is_relative_to(root) and path.is_file() and path.suffix != ".md":
            yield path


def collect(folder: Path, campaigns: list[Path], root: Path = ROOT) -> None:
    """Make the folder anew."""
    shutil.rmtree(folder, ignore_errors=True)
    for path in {*pages(root), *(target for page in pages(root) for target in linked(page, root))}:
        place = folder / path.relative_to(root)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, place)
    for name in ("docs/reference", "docs/explanation", "docs/explanation/decisions", "docs/tutorials", "docs"):
        _list(folder / name)
    _gallery(folder / "gallery", campaigns)


def _list(folder: Path) -> None:
    """A page that lists the others of a folder, and its folders, where it has none."""
    if (index := folder / "README.md").exists():
        return
    lines = [f"- [{_title(page)}]({page.name})" for page in sorted(folder.glob("*.md"))]
    lines += [
        f"- [{inner.name}]({inner.name}/README.md)"
        for inner in sorted(folder.iterdir())
        if (inner / "README.md").exists()
    ]
    index.write_text("\n".join([f"# {folder.name.capitalize()}", "", *lines, ""]), encoding="utf-8")


def _title(page: Path) -> str:
    found = TITLE.search(page.read_text(encoding="utf-8"))
    return found[1] if found else page.stem


def _gallery(folder: Path, campaigns: list[Path]) -> None:
    """Reports of the campaigns' runs, and a page that shows what each ended with."""
    folder.mkdir()
    lines = ["# Gallery", "", "Reports of procedures on simulated rigs, as the bench makes them."]
    for campaign in campaigns:
        lines += ["", f"## {campaign.name.split('.')[0]}", "", "| procedure | rig | outcome |", "|---|---|---|"]
        for report in sorted(campaign.glob("runs/*/report.html"), key=lambda path: path.parent.name.rsplit("-", 2)[1]):
            record = json.loads((report.parent / "record.json").read_text(encoding="utf-8"))
            name = f"{campaign.name.split('.')[0]}-{report.parent.name}.html"
            shutil.copy(report, folder / name)
            lines.append(f"| [{record['procedure']}]({name}) | {record['rig']} | {record['outcome']} |")
    if not campaigns:
        lines += ["", "None was made with this site: `make gallery site`."]
    (folder / "README.md").write_text("\n".join([*lines, ""]), encoding="utf-8")


if __name__ == "__main__":
    collect(Path(sys.argv[1]), [Path(argument) for argument in sys.argv[2:]])
