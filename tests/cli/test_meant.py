"""Which stored run a command is for: by path, name, the beginning of one, `last`; and none that is still being written."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench import lock
from bench.cli.meant import meant
from tests.cli.in_process import Bench, bench_in_process

QUICK = ("--plan", "angles=1", "--plan", "rounds=1", "--plan", "settle_s=0.3", "--plan", "average_s=0.2", "--no-report")


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one run."""
    from bench.cli.__main__ import main

    folder = tmp_path_factory.mktemp("lab")
    assert main(("run", "amb-calibration", "--rig", "tsbs12", *QUICK, "--out", str(folder / "runs"))) == 0
    return folder


@pytest.fixture
def bench(lab: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Bench:
    monkeypatch.chdir(lab)
    return bench_in_process(capsys)


def test_a_run_is_meant_by_its_name_its_beginning_and_as_the_last(lab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(lab)
    (run,) = (path for path in (lab / "runs").iterdir() if path.is_dir())
    for word in ("last", run.name, run.name[:20], str(run), f"runs/{run.name}/recording.mcap", f"{run}/record.json"):
        assert meant(word).resolve() == run
    assert meant(f"runs/{run.name}") == Path("runs", run.name)  # as it was typed


def test_commands_for_a_stored_run_take_its_name(lab: Path, bench: Bench) -> None:
    (run,) = (path for path in (lab / "runs").iterdir() if path.is_dir())
    assert bench("export", "last", "--to", "csv")[:2] == (0, f"{run}/export\n")
    status, out, _ = bench("analyse", run.name[:20])
    assert (status, Path(out.strip()).parent) == (0, run / "analyses")


def test_no_such_run_is_told_with_where_it_was_looked_for(
    lab: Path, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for command in (("analyse",), ("report",), ("export",), ("adopt",), ("run", "--continue")):
        status, out, err = bench(*command, "unbalance")
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert "unbalance: found no run directory of that name, here or in runs; expected" in err
    monkeypatch.chdir(tmp_path)
    status, _, err = bench("export", "last")
    assert (status, err) == (
        2,
        "bench: last: found nothing; expected a run directory, or a run by its name in ./runs, which has none. "
        "Next: give its path\n",
    )


def test_a_run_that_is_still_being_written_is_left_alone(lab: Path, bench: Bench) -> None:
    (run,) = (path for path in (lab / "runs").iterdir() if path.is_dir())
    before = sorted(run.rglob("*"))
    with (run / "recording.mcap").open("rb") as file:
        lock.hold(file.fileno())
        for command in ("analyse", "report", "export", "adopt"):
            status, out, err = bench(command, "last")
            assert (status, out, err.count("\n")) == (2, "", 1)
            assert "last: found a run that is still being written; expected one that has ended; nothing" in err
    assert sorted(run.rglob("*")) == before
