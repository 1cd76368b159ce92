"""The same campaign on a Dask cluster of two workers, in processes of their own."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from test_campaign import HEAD, TWO, environment

pytestmark = pytest.mark.long
KEYS = ("seed", "values", "findings", "stopped")


@contextmanager
def cluster(tmp_path: Path, threads: int = 1) -> Iterator[str]:
    with subprocess.Popen(
        [sys.executable, "-m", "dask_cluster", str(threads)], cwd=tmp_path, env=environment(), text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    ) as child:  # fmt: skip
        assert child.stdout is not None
        assert child.stdin is not None
        yield child.stdout.readline().strip()
        child.stdin.close()


def bench(tmp_path: Path, *arguments: str) -> tuple[int, str, str]:
    (tmp_path / "c.toml").write_text(HEAD + TWO)
    done = subprocess.run(
        [sys.executable, "-m", "campaign_catalogue", "campaign", "c.toml", "--no-report", *arguments], cwd=tmp_path,
        env=environment(), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert "Traceback" not in done.stdout + done.stderr, done.stderr
    return done.returncode, done.stdout, done.stderr


def rigs(tmp_path: Path, out: str) -> list[dict[str, Any]]:
    lines = [json.loads(line) for line in (tmp_path / out.strip() / "journal.jsonl").read_text().splitlines()]
    found = sorted((e for e in lines if e["kind"] == "rig"), key=lambda e: e["seed"])
    return [{k: e[k] for k in KEYS} for e in found]


@pytest.mark.timeout(300)
def test_two_workers_give_what_this_machine_gives(tmp_path: Path) -> None:
    with cluster(tmp_path) as address:
        status, out, err = bench(tmp_path, "--count", "6", "--scheduler", address)
    assert status == 5, err
    assert len(rigs(tmp_path, out)) == 6
    lines = (tmp_path / out.strip() / "journal.jsonl").read_text().splitlines()
    assert {json.loads(line).get("jobs") for line in lines} == {2, None}
    _, here, _ = bench(tmp_path, "--count", "6", "--jobs", "1", "--keep", "none", "--new")
    assert rigs(tmp_path, out) == rigs(tmp_path, here)
    assert not (tmp_path / out.strip() / "recordings").exists()


@pytest.mark.timeout(300)
def test_a_worker_with_threads_is_refused(tmp_path: Path) -> None:
    with cluster(tmp_path, threads=2) as address:
        status, _, err = bench(tmp_path, "--count", "2", "--scheduler", address)
    assert status == 2
    assert "one process per core" in err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--count", "2", "--scheduler", "tcp://127.0.0.1:9"), "no answer"),
        (("--scheduler", "tcp://127.0.0.1:9"), "for many virtual rigs"),
        (("--count", "2", "--jobs", "3", "--scheduler", "tcp://127.0.0.1:9"), "--jobs"),
        (("--count", "2", "--keep", "all", "--scheduler", "tcp://127.0.0.1:9"), "--keep all"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, arguments: tuple[str, ...], said: str) -> None:
    status, _, err = bench(tmp_path, *arguments)
    assert status == 2, err
    assert said in err
