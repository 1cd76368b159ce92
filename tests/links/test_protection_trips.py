"""Each protected reading of another laboratory's rigs trips, and the machine is made safe: in one process, and served over the
rig's own DBC."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import processes
import pytest
from test_example_rigs import held

from bench.cli.__main__ import main
from bench.cli.virtual import Knobs, flown
from bench.errors import InterlockError
from bench.recording import Recording
from bench.rigfile import RigFile, load_rig, protection
from bench.rigfile.protection import Protected

ROOT = Path(__file__).resolve().parents[2]
RIGS = [ROOT / "examples" / name for name in ("vertical-spindle/spindle.toml", "plain-stand/stand.toml")]
COARSE = Knobs(substeps=1, plain=True)  # of the run, to save time
BEYOND = 0.02  # of a limit
PATIENCE_S = 3.0  # of a watchdog: a test machine that gives its processes no time for so long is no dead host


@cache
def loaded(path: Path) -> RigFile:
    """Once for all the cases, which are made whenever tests are collected."""
    return load_rig(str(path))


def beyond(path: Path, p: Protected) -> float:
    """A value beyond a limit that a channel's signal can say: the end where there is room for one."""
    low, high = held(loaded(path), p.name) if " " not in p.name else (-math.inf, math.inf)
    ends = [limit + sign * BEYOND * abs(limit) for limit, sign in ((p.high, 1), (p.low, -1)) if math.isfinite(limit)]
    return next(x for x in ends if low < x < high)


def each() -> Iterator[Any]:
    for path in RIGS:
        for p in protection.all_of(loaded(path)):
            yield pytest.param(path, p.name, beyond(path, p), id=f"{path.stem}-{p.name}")


EACH = pytest.mark.parametrize(("path", "name", "value"), list(each()))


def each_served() -> Iterator[Any]:
    """One reading of each message and limit is served in CI; the bytes of every reading are the same in one process."""
    known = set()
    for path in RIGS:
        rig = loaded(path)
        for p in protection.all_of(rig):
            source = (
                rig.channels[p.name].signal.partition(".")[0] if p.name in rig.channels else p.name.partition(" ")[0]
            )
            kind = (path, source, p.low, p.high)
            mark = pytest.mark.links if kind in known else pytest.mark.long
            known.add(kind)
            yield pytest.param(path, p.name, beyond(path, p), id=f"{path.stem}-{p.name}", marks=mark)


def key(name: str) -> str:
    return f"reading.{name.replace(' ', '.')}"


def made_safe(path: Path) -> None:
    """The recording says that the rotor was held, then landed, then switched off."""
    recording: Recording[Any] = Recording.open(path)
    rig = recording.rig
    modes = [rig.binding.mode(rig.choices("state")[int(code)]) for code in recording.channel("state")["state"]]
    found = [a for a, b in zip(modes, [None, *modes], strict=False) if a != b]
    assert found[found.index("READY") :][:3] == ["READY", "LIFTING", "LEVITATED"]
    assert found[-3:] == ["LANDING", "READY", "OFF"]


@EACH
def test_each_protected_reading_trips_and_the_machine_is_safe(
    path: Path, name: str, value: float, tmp_path: Path
) -> None:
    done = flown("step", str(path), 1, {}, tmp_path / "trip.mcap", {key(name): value}, knobs=COARSE)
    assert isinstance(done.machine.cause, InterlockError)
    assert re.search(rf"\b{re.escape(name)} (reached|fell to) ", str(done.machine.cause))
    assert [f.code for f in done.machine.ending.findings] == ["interlock"]
    made_safe(tmp_path / "trip.mcap")


@pytest.mark.parametrize("path", RIGS)
def test_check_prints_what_trips(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(("check", str(path))) == 0
    out = capsys.readouterr().out
    said = " ".join(out[out.index("protected always:") : out.index("without a limit:")].split())
    listed = {name for one in re.findall(r": ([^:]*?)(?= ±| \d| at |$| protected)", said) for name in one.split(", ")}
    assert {p.values[1] for p in each() if p.values[0] == path} <= listed


def patient(path: Path, folder: Path) -> None:
    """The rig in `folder/rigs`, with a watchdog of seconds."""
    (folder / "rigs").mkdir()
    text = path.read_text(encoding="utf-8")
    text = re.sub(r"(AliveTimeout = .*default = )[\d.]+(.*high = )[\d.]+", rf"\g<1>{PATIENCE_S}\g<2>{PATIENCE_S}", text)
    text = text.replace("[simulation]\n", f"[simulation]\nwatchdog_s = {PATIENCE_S}\n", 1)
    (folder / "rigs" / path.name).write_text(text, encoding="utf-8")
    dbc = path.with_suffix(".dbc")
    (folder / "rigs" / dbc.name).write_bytes(dbc.read_bytes())


def links(endpoints: Sequence[str]) -> list[str]:
    """`--link` options for what `bench serve` printed: the first endpoint of each link."""
    first: dict[str, str] = {}
    for line in endpoints:
        name, _, url = line.partition(" ")
        first.setdefault(name, url)
    return [x for name, url in first.items() if url for x in ("--link", f"{name}={url}")]


@pytest.mark.parametrize(("path", "name", "value"), list(each_served()))
@pytest.mark.timeout(180)
def test_each_protected_reading_of_the_served_rig_trips(path: Path, name: str, value: float, tmp_path: Path) -> None:
    patient(path, tmp_path)
    rig = load_rig(str(path))
    free = [f"{link}={re.sub(r'[^/:]+:[0-9]+$', '127.0.0.1:0', spec.url)}" for link, spec in rig.links.items()]
    ports = [x for one in free for x in ("--link", one)]
    serve = ("serve", path.stem, "--truth", f"{key(name)}={value!r}", *ports)
    with processes.real_bench(tmp_path, *serve) as server:
        server.wait_for("ready")
        run = ("run", "step", "--rig", path.stem, "--backend", "live", "--operator", "auto", "--no-report")
        with processes.real_bench(tmp_path, *run, *links(server.out)) as child:
            status = child.end()
            record = processes.record_in(tmp_path, child)
    found = [f["code"] for f in record["findings"]]
    assert (status, record["outcome"]) == (4, "ABORTED"), record["findings"]
    assert "interlock" in found
    assert "make-safe-failed" not in found
    (said,) = [f["text"] for f in record["findings"] if f["code"] == "interlock"]
    assert re.search(rf"\b{re.escape(name)} (reached|fell to) ", said)
    (recording,) = (tmp_path / "runs").glob("*/recording.mcap")
    made_safe(recording)
