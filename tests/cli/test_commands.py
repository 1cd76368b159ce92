"""The commands in this process: what they print and the exit status they end with."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from in_process import Bench, bench_in_process
from pyarrow import parquet
from tiny_catalogue import TINY

from bench import catalogue
from bench.cli import check

SHIPPED = catalogue.PROCEDURES


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Bench:
    """`bench` in an empty directory with the small procedure: exit status, standard output, standard error."""
    monkeypatch.setattr(catalogue, "PROCEDURES", TINY)
    monkeypatch.chdir(tmp_path)
    return bench_in_process(capsys)


def run(*extra: str) -> tuple[str, ...]:
    return ("run", "tiny-levitated", "--rig", "tsbs12", "--no-report", *extra)


def spec(tmp_path: Path, low: float, high: float, at: str = "") -> None:
    (tmp_path / "specs").mkdir()
    (tmp_path / "specs" / "tsbs12.toml").write_text(
        f'schema = 1\n[limits.tiny-levitated]\nsupply = {{ low = {low}, high = {high}, unit = "V", source = "test", '
        f"verified = true{at} }}\n"
    )


def outcome_of(out: str) -> tuple[str, list[str]]:
    """Outcome and codes of the findings of the run or analysis whose directory a command printed last."""
    record = json.loads((Path(out.splitlines()[-1]) / "record.json").read_text())
    return record["outcome"], [f["code"] for f in record["findings"]]


@pytest.mark.parametrize(
    ("low", "high", "status", "outcome"),
    [(140.0, 160.0, 0, "PASS"), (160.0, 180.0, 1, "FAIL"), (148.0, 160.0, 5, "INDETERMINATE")],
)
def test_verdicts_are_exit_statuses(
    bench: Bench, tmp_path: Path, low: float, high: float, status: int, outcome: str
) -> None:
    spec(tmp_path, low, high)
    found, out, err = bench(*run())
    assert found == status
    assert any(line.startswith(f"{outcome}: tiny-levitated on tsbs12") for line in err.splitlines())
    directory = Path(out.splitlines()[-1])
    assert directory.parent == Path("runs")
    assert json.loads((directory / "record.json").read_text())["outcome"] == outcome
    found, out, _ = bench("analyse", str(directory))
    assert found == status
    assert (Path(out.splitlines()[-1]) / "record.json").is_file()


def test_a_run_that_nothing_judged_is_done(bench: Bench) -> None:
    """It passes nothing and fails nothing; who needs a verdict asks for one, and so does a spec that is named."""
    status, out, err = bench(*run())
    assert (status, outcome_of(out)) == (0, ("DONE", []))
    assert "DONE: tiny-levitated on tsbs12\n  decided  no acceptance limit was applied\n" in err
    status, out, err = bench(*run("--require-verdict"))
    assert (status, outcome_of(out)) == (3, ("ERROR", ["nothing-judged"]))
    assert "there is no limit for this procedure" in " ".join(err.split())
    status, out, _ = bench("analyse", out.splitlines()[-1])
    assert (status, outcome_of(out)) == (3, ("ERROR", ["nothing-judged"]))
    Path("mine.toml").write_text("schema = 1\n[limits.other]\n")
    status, out, _ = bench(*run("--spec", "mine.toml"))
    assert (status, outcome_of(out)) == (3, ("ERROR", ["nothing-judged"]))


def test_a_limit_judges_at_the_settings_that_it_was_stated_for(bench: Bench, tmp_path: Path) -> None:
    spec(tmp_path, 160.0, 180.0, ", at = { bias_A = 3.0 }")
    status, out, _ = bench(*run("--require-verdict"))
    assert (status, outcome_of(out)) == (1, ("FAIL", []))
    status, out, err = bench(*run("--plan", "bias_A=2.0"))
    assert (status, outcome_of(out)) == (0, ("DONE", ["limit-not-applied"]))
    assert "no verdict on supply: the limit was stated for bias_A = 3, here it is 2" in " ".join(err.split())
    status, out, _ = bench("analyse", out.splitlines()[-1])
    assert (status, outcome_of(out)) == (0, ("DONE", ["limit-not-applied"]))
    status, out, err = bench(*run("--plan", "bias_A=2.0", "--require-verdict"))
    assert (status, outcome_of(out)) == (3, ("ERROR", ["limit-not-applied", "nothing-judged"]))
    assert "none of its limits holds for this plan" in " ".join(err.split())


def test_a_fail_stands_first_and_a_finding_outranks_it(bench: Bench, tmp_path: Path) -> None:
    spec(tmp_path, 160.0, 180.0)
    status, out, err = bench(*run("--plan", 'then="doubt"'))
    assert (status, outcome_of(out)[0]) == (5, "INDETERMINATE")
    head, first = err[err.index("INDETERMINATE: ") :].splitlines()[:2]
    assert head == "INDETERMINATE: tiny-levitated on tsbs12"
    assert first == "  decided  outside its limit, but outranked by doubt: supply"


@pytest.mark.parametrize(("act", "status"), [("raise", 3), ("refuse", 4), ("stop", 4)])
def test_what_ends_a_run_early_is_an_exit_status(bench: Bench, act: str, status: int) -> None:
    found, out, err = bench(*run("--plan", f'act="{act}"'))
    assert found == status
    assert (Path(out.splitlines()[-1]) / "recording.mcap").is_file()
    assert "stopped: " in err


USAGE = [
    (("nonsense",), "nonsense"),
    ((), "Usage"),
    (("run",), "PROCEDURE"),
    (("run", "tiny-levitated"), "--rig"),
    (("run", "tiny-levitatd", "--rig", "tsbs12"), "Did you mean tiny-levitated?"),
    (("run", "tiny-levitated", "--rig", "tsbs13"), "Did you mean tsbs12?"),
    (run("--seed", "one"), "--seed"),
    (run("--seed", "-1"), "--seed"),
    (run("--backend", "cloud"), "--backend"),
    (run("--backend", "live", "--seed", "1"), "no seed"),
    (
        run("--backend", "live", "--visit", "0"),
        "--visit: a real rig has no seed, no visit and no truth to set; expected",
    ),
    (run("--visit", "-1"), "--visit"),
    (run("--backend", "live", "--truth", "K_i=70"), "no truth"),
    (run("--backend", "live", "--link", "controller=inprocess:"), "inprocess"),
    (run("--backend", "live", "--link", "controller=slcam:/dev/ttyACM0"), "did you mean 'slcan:/dev/ttyACM0'?"),
    (run("--backend", "live", "--link", "controller=slcan:socket://127.0.0.1:9"), "nobody listens"),
    (run("--backend", "live", "--link", "controller=serial:/dev/ttyNONE"), "/dev/ttyNONE"),
    (run("--backend", "live", "--link", "controller=can:sockedcan:can0"), "sockedcan"),
    (run("--link", "controller=can:socketcan:can0"), "--link"),
    (run("--truth", "K_x=70"), "K_x"),
    (run("--truth", 'K_i="much"'), "a number"),
    (run("--plan", "secunds=1"), "secunds"),
    (run("--spec", "absent.toml"), "absent.toml"),
    (run("--plan", "seconds"), "KEY=VALUE"),
    (run("--plan", "bias_A=7"), "the envelope allows"),
    (run("--plan-file", "absent.toml"), "absent.toml"),
    (("analyse", "."), "neither recording"),
    (("analyse", "absent"), "found nothing"),
    (("report", "absent"), "found nothing"),
    (("export", "absent"), "found nothing"),
    (("export", ".", "--to", "xlsx"), "--to"),
    (("check", "absent"), "absent"),
]


@pytest.mark.parametrize(("arguments", "said"), USAGE, ids=[" ".join(a) or "(nothing)" for a, _ in USAGE])
def test_usage_and_configuration_errors(bench: Bench, tmp_path: Path, arguments: tuple[str, ...], said: str) -> None:
    status, out, err = bench(*arguments)
    assert status == 2
    assert said in err + out
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_way_of_the_run_directory(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "runs").write_text("precious")
    status, out, err = bench(*run())
    assert (status, out) == (2, "")
    assert "no run directory can be made there" in err
    assert (tmp_path / "runs").read_text() == "precious"


@pytest.mark.parametrize("content", [b"", b"no recording at all", b"\x89MCAP0\r\n"])
@pytest.mark.parametrize("command", ["analyse", "export"])
def test_a_foreign_recording(bench: Bench, tmp_path: Path, content: bytes, command: str) -> None:
    (tmp_path / "recording.mcap").write_bytes(content)
    status, _, err = bench(command, ".")
    assert status == 3
    assert "recording.mcap" in err
    assert (tmp_path / "recording.mcap").read_bytes() == content


def test_a_damaged_recording(bench: Bench) -> None:
    _, out, _ = bench(*run())
    path = Path(out.splitlines()[-1]) / "recording.mcap"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    status, _, err = bench("analyse", str(path.parent))
    assert status == 3
    assert "CRC" in err


def test_list_and_help_name_what_there_is(bench: Bench) -> None:
    status, out, _ = bench("list")
    assert status == 0
    assert "tiny-levitated" in out
    assert "tsbs12" in out
    status, out, _ = bench("--help")
    assert status == 0
    for command in ("list", "check", "run", "analyse", "report", "runs", "export"):
        assert f"  {command} " in out


def test_help_says_what_each_command_does_in_whole_sentences(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    _, out, _ = bench("--help")
    lines = out.partition("Commands:\n")[2].splitlines()
    assert len(lines) > 15
    assert [line for line in lines if not line.endswith(".") or line.endswith("...")] == []


def test_a_list_goes_on_below_itself_on_a_narrow_terminal() -> None:
    rows = [
        ("step", "Steps"),
        ("static-characteristics", "Static torque and force of a machine's phases, by load cells"),
    ]
    assert list(check._rows(rows, 60)) == [
        "  step                    Steps",
        "  static-characteristics  Static torque and force of a",
        "                          machine's phases, by load cells",
    ]
    assert list(check._rows(rows, None))[1].endswith("by load cells")


def test_check_says_the_bus_load(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalogue, "PROCEDURES", SHIPPED)  # the rig file has default plans of theirs
    status, out, _ = bench("check", "tsbs12")
    assert status == 0
    assert "bus load" in out


def test_check_names_every_problem_at_once(bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = catalogue.rig_path("tsbs12")
    text = source.read_text(encoding="utf-8")
    text = text.replace("latitude_deg = 53.527", "latitude_deg = 153").replace("max_speed_rad_s = ", "max_sped = ")
    (tmp_path / "bad.toml").write_text(text, encoding="utf-8")
    (tmp_path / "tsbs12.dbc").write_text((source.parent / "tsbs12.dbc").read_text(encoding="utf-8"), encoding="utf-8")
    with monkeypatch.context() as shipped:
        shipped.setattr(catalogue, "PROCEDURES", SHIPPED)
        status, _, err = bench("check", "bad.toml")
    assert status == 2
    for said in ("site.latitude_deg", "max_sped", "max_speed_rad_s", "bad.toml", "3 problems"):
        assert said in err
    status, _, err = bench("run", "tiny-levitated", "--rig", "bad.toml")
    assert status == 2
    assert "site.latitude_deg" in err
    assert not (tmp_path / "runs").exists()


def test_check_names_an_unknown_unit_beside_the_other_problems(bench: Bench, tmp_path: Path) -> None:
    source = catalogue.rig_path("tsbs12")
    text = source.read_text(encoding="utf-8").replace("latitude_deg = 53.527", "latitude_deg = 153")
    (tmp_path / "bad.toml").write_text(text.replace('unit = "m/s^2"', 'unit = "furlong"'), encoding="utf-8")
    (tmp_path / "tsbs12.dbc").write_text((source.parent / "tsbs12.dbc").read_text(encoding="utf-8"), encoding="utf-8")
    status, _, err = bench("check", "bad.toml")
    assert status == 2
    assert "furlong" in err
    assert "site.latitude_deg" in err


def test_runs_lists_them_and_rebuilds_a_lost_index(bench: Bench, tmp_path: Path) -> None:
    assert bench("runs") == (0, "", "no runs in runs\n")
    _, out, _ = bench(*run("--seed", "7", "--visit", "2"))
    directory = out.splitlines()[-1]
    for _ in range(2):
        status, out, _ = bench("runs")
        assert status == 0
        assert out.startswith("DONE")
        assert "seed 7, visit 2" in out
        assert directory in out
        (tmp_path / "runs" / "index.sqlite").unlink()


def test_export_writes_every_sample_of_every_channel(bench: Bench) -> None:
    _, out, _ = bench(*run())
    directory = out.splitlines()[-1]
    assert bench("export", directory)[0] == 0
    assert bench("export", directory, "--to", "csv")[0] == 0
    table = parquet.read_table(Path(directory) / "export" / "telemetry.parquet")
    assert table.schema.field("pos_xi").metadata[b"unit"] == b"m"
    with (Path(directory) / "export" / "telemetry.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert len(rows) - 1 == table.num_rows > 1000
    column = rows[0].index("supply")
    assert float(rows[1][column]) == pytest.approx(table["supply"][0].as_py(), rel=1e-6)
    assert table["index"].to_pylist() == list(range(table.num_rows))


def test_export_writes_what_was_found_too(bench: Bench) -> None:
    _, out, _ = bench(*run())
    directory = Path(out.splitlines()[-1])
    assert bench("export", str(directory))[0] == 0
    (row,) = parquet.read_table(directory / "export" / "results.parquet").to_pylist()
    (said,) = json.loads((directory / "record.json").read_text())["measurements"]
    assert (row["name"], row["value"], row["low"]) == ("supply", said["value"], said["interval"][0])
    (directory / "record.json").unlink()
    (directory / "export" / "results.parquet").unlink()
    assert bench("export", str(directory))[0] == 0
    assert not (directory / "export" / "results.parquet").exists()


def test_a_report_can_be_built_again(bench: Bench) -> None:
    _, out, _ = bench(*run())
    directory = Path(out.splitlines()[-1])
    assert not (directory / "report.html").exists()
    status, out, _ = bench("report", str(directory))
    assert status == 0
    assert (directory / "report.html").stat().st_size > 1000
    assert (directory / "report.pdf").read_bytes().startswith(b"%PDF")


def test_the_catalogue_tells_the_truth() -> None:
    from bench.cli.loading import load_procedure

    for entry in catalogue.PROCEDURES:
        assert load_procedure(entry.name).name == entry.name
