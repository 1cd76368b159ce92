"""The directory of a campaign: what it was started with, its journal, and finding the one to go on with.

`<out>/<name>.campaign-<UTC>-<4 hex>` holds `campaign.json` (what it was started with), `journal.jsonl`, the run
directories in `runs/`, calibrations, kept recordings and the summary.
"""

from __future__ import annotations

import json
import os
import re
import secrets
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from bench.campaign.journal import Journal
from bench.errors import ConfigError
from bench.lock import rig_lock
from bench.rundir import stamp

NEXT = "Next: put it back to go on with that campaign, or give --new to start another"


@dataclass(frozen=True, slots=True)
class CampaignDirectory:
    """The files of one campaign. Only the names live here."""

    path: Path

    @property
    def started_with(self) -> Path:
        return self.path / "campaign.json"

    @property
    def journal(self) -> Journal:
        return Journal(self.path / "journal.jsonl")

    @property
    def runs(self) -> Path:
        return self.path / "runs"

    @property
    def calibrations(self) -> Path:
        return self.path / "calibrations"

    @property
    def model(self) -> Path:
        return self.path / "model.json"

    @property
    def coverage(self) -> Path:
        return self.path / "coverage.json"

    @property
    def done(self) -> bool:
        """Nothing is left to do: the journal's last line says so."""
        last: Mapping[str, Any] = {}
        for last in self.journal.entries():  # noqa: B007 (the last one is wanted)
            pass
        return last.get("kind") == "done"

    @contextmanager
    def locked(self) -> Iterator[None]:
        """One process works on a campaign at a time.

        Raises:
            ConfigError: another one does.
        """
        lock = rig_lock(f"campaign {self.path.resolve()}", self.path / ".lock")
        try:
            lock.__enter__()
        except ConfigError as error:
            raise ConfigError(f"{self.path}: another process works on this campaign ({error})") from error
        try:
            yield
        finally:
            lock.__exit__(None, None, None)


def newest(out: Path, name: str) -> CampaignDirectory | None:
    """The campaign of that name that was started last."""
    pattern = re.compile(rf"{re.escape(name)}\.campaign-\d{{8}}T\d{{6}}Z-[0-9a-f]{{4}}")
    found = [CampaignDirectory(p) for p in out.glob(f"{name}.campaign-*") if pattern.fullmatch(p.name)]
    whole = [d for d in found if d.started_with.is_file()]
    return max(whole, key=lambda d: (d.started_with.stat().st_mtime_ns, d.path.name), default=None)


def opened(out: Path, name: str, identity: Mapping[str, Any], new: bool) -> tuple[CampaignDirectory, bool]:
    """The unfinished campaign to go on with, else a new one; and whether it is gone on with.

    Raises:
        ConfigError: the unfinished one was started with something else, or the directory cannot be made.
    """
    last = None if new else newest(out, name)
    if last is None or last.done:
        return _created(out, name, identity), False
    before = _read(last.started_with)
    changed = list(_differences(before, json.loads(json.dumps(identity))))
    if changed:
        raise ConfigError("\n  ".join([f"{last.path}: not finished, and started with something else:", *changed, NEXT]))
    return last, True


def _created(out: Path, name: str, identity: Mapping[str, Any]) -> CampaignDirectory:
    try:
        out.mkdir(parents=True, exist_ok=True)
        path = out / f"{name}.campaign-{stamp(datetime.now(UTC))}-{secrets.token_hex(2)}"
        path.mkdir()
        directory = CampaignDirectory(path)
        part = path / "campaign.json.part"  # without campaign.json the directory is no campaign
        part.write_text(json.dumps(identity, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
        os.replace(part, directory.started_with)
    except OSError as error:
        raise ConfigError(
            f"--out {out}: no campaign directory can be made there: {error.strerror or error} ({error.filename})"
        ) from error
    return directory


def _read(path: Path) -> Any:
    """What a campaign was started with. Those of before there were visits are of visit 0."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        return {"visit": 0} | found if isinstance(found, dict) and found.get("backend") == "sim" else found
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}. Next: --new starts another campaign") from error


def _differences(before: Any, now: Any, key: str = "") -> Iterator[str]:
    if isinstance(before, dict) and isinstance(now, dict):
        for name in dict.fromkeys([*before, *now]):
            yield from _differences(before.get(name), now.get(name), f"{key}.{name}" if key else str(name))
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for number, (a, b) in enumerate(zip(before, now, strict=True), 1):
            yield from _differences(a, b, f"{key}.{number}")
    elif before != now:
        yield f"{key}: started with {_short(before)}, now {_short(now)}"


def _short(value: Any) -> str:
    text = "nothing" if value is None else json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."
