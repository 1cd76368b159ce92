"""A procedure in one file: run, analysed and reported again by naming it, and by nothing else."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from in_process import Bench, bench_in_process
from packages import install, small

from bench.cli import loading
from bench.rigfile import load_rig

RIG = ("--rig", "tsbs12", "--no-report")


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Bench]:
    """`bench` in a folder with `look.py`; each command as a process of its own would have it: it knows no file yet."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    Path("look.py").write_text(small("look-here"))
    command = bench_in_process(capsys)

    def fresh(*arguments: str) -> tuple[int, str, str]:
        loading._files.clear()
        return command(*arguments)

    yield fresh
    loading._files.clear()


def record_of(out: str) -> tuple[Path, dict[str, Any]]:
    folder = Path(out.splitlines()[-1])
    return folder, json.loads((folder / "record.json").read_text())


def test_it_is_run_and_analysed_by_its_file(bench: Bench) -> None:
    status, out, err = bench("run", "./look.py", *RIG)
    assert status == 0, err
    run, record = record_of(out)
    assert record["procedure"] == "look-here"
    assert re.fullmatch("sha256:[0-9a-f]{64}", record["versions"]["look.py"])
    status, _, err = bench("analyse", str(run))
    assert status == 2
    path = Path("look.py").resolve()
    assert f"{run.resolve()}: was made by 'look-here' of the file {path}, and the bench executes no file" in err
    assert f"Next: `bench analyse {run.resolve()} --procedure {path}`" in err
    status, out, err = bench("analyse", str(run), "--procedure", "look.py")
    assert (status, "is not as it was" in err) == (0, False)
    assert record_of(out)[1]["measurements"] == record["measurements"]
    assert bench("adopt", str(run))[0] == 2
    status, out, err = bench("adopt", str(run), "--procedure", str(path), "--rig", "tsbs12", "--calibrations", "known")
    assert status == 0, err
    assert Path(out.strip()).name == "look-here.json"


def test_a_file_that_was_changed_says_so_and_one_that_is_gone_is_had_from_the_recording(bench: Bench) -> None:
    run, record = record_of(bench("run", "./look.py", *RIG)[1])
    before = Path("look.py").read_bytes()
    Path("look.py").write_text(small("look-here").replace("1e-3", "2e-3"))
    status, out, err = bench("analyse", str(run), "--procedure", "look.py")
    assert status == 0
    assert "look.py is not as it was when the run was made" in err
    wider = record_of(out)[1]["measurements"][0]["standard_uncertainty"]
    assert wider == pytest.approx(2 * record["measurements"][0]["standard_uncertainty"])
    Path("look.py").unlink()
    status, _, err = bench("analyse", str(run))
    assert status == 2
    ways = re.findall(r"`([^`]*)`", err)
    command = ways[0].replace("python", sys.executable, 1)
    subprocess.run(["bash", "-c", command], check=True)
    assert Path("look.py").read_bytes() == before
    status, _, err = bench(*ways[1].split()[1:])
    assert (status, "is not as it was" in err) == (0, False)


def test_what_needs_no_procedure_is_exported_without_it(bench: Bench) -> None:
    run, _ = record_of(bench("run", "./look.py", *RIG)[1])
    status, out, err = bench("export", str(run), "--to", "csv")
    assert status == 0, err
    assert "figures are left out" in err
    assert {"telemetry.csv", "results.csv"} <= {p.name for p in Path(out.strip()).iterdir()}


def test_a_report_is_built_again(bench: Bench) -> None:
    run, _ = record_of(bench("run", "./look.py", *RIG)[1])
    assert bench("report", str(run))[0] == 2
    status, _, err = bench("report", str(run), "--procedure", "look.py")
    assert status == 0, err
    text = (run / "report.html").read_text()
    assert "mean supply voltage" in text
    assert "look.py" in text


def test_another_procedure_is_refused(bench: Bench) -> None:
    run, _ = record_of(bench("run", "./look.py", *RIG)[1])
    Path("other.py").write_text(small("other"))
    status, _, err = bench("analyse", str(run), "--procedure", "other.py")
    assert status == 2
    assert "--procedure other.py: found 'other'; expected 'look-here'" in err


def test_a_package_of_that_name_is_not_taken_for_it(bench: Bench, tmp_path: Path) -> None:
    run, _ = record_of(bench("run", "./look.py", *RIG)[1])
    install(tmp_path / "site", "lev-look", {"levbench.procedures": {"look-here": "lev_look:procedure"}}, {})
    sys.path.insert(0, str(tmp_path / "site"))
    status, _, err = bench("analyse", str(run))
    assert status == 2
    assert "was made by 'look-here' of the file" in err
    status, _, err = bench("run", "./look.py", *RIG)
    assert status == 2
    assert "procedure 'look-here' is taken twice: found lev-look 1.2 (lev_look:procedure) and the file look.py" in err


WRONG = {
    "missing.py": (None, "No such file or directory; expected a Python file that holds a procedure"),
    "syntax.py": ("procedure = (\n", "cannot be executed: SyntaxError: '(' was never closed (syntax.py, line 1)"),
    "null.py": ("procedure = 1\0", "cannot be executed: "),
    "raises.py": ("import json\njson.loads('{')\nprocedure = 1", "cannot be executed: JSONDecodeError in "),
    "exits.py": ("raise SystemExit(0)", "cannot be executed: SystemExit in exits.py:1: 0"),
    "empty.py": ("", "found no `procedure`; expected `procedure = Procedure(...)`"),
    "three.py": ("procedure = 3", "found procedure = a int; expected `procedure = Procedure(...)`"),
    "ours.py": (small("spindown"), "procedure 'spindown' is taken twice: found levbench (procedures.spindown.procedure) and "
                                   "the file ours.py"),
    "named.py": (small("../x"), "name: found '../x'; expected words of a-z and 0-9"),
    "listen.py": (small("listen"), "name: found 'listen'"),
    "half.py": (small("half").replace("measured=measured,", ""), "missing 1 required positional argument: 'measured'"),
    "check.py": (small("looks").replace("step_count=", "check=lambda rig, plan: [1 / 0], step_count="),
                 "procedure file check.py: ZeroDivisionError in check.py:33: division by zero; nothing was started"),
    "plan.py": (small("looks").replace("seconds: float = 0.3", "seconds: float = 'x'"),
                "plan.seconds: found 'x' as its default; expected another"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_file_that_cannot_be_is_one_message(bench: Bench, name: str) -> None:
    text, expected = WRONG[name]
    if text is not None:
        Path(name).write_text(text)
    status, _, err = bench("run", name, *RIG)
    assert status == 2
    assert expected in " ".join(err.split())
    assert name in err
    assert not Path("runs").exists()


def test_a_folder_and_a_name_without_its_ending(bench: Bench) -> None:
    assert "Is a directory" in bench("run", "./", *RIG)[2]
    status, _, err = bench("run", "look", *RIG)
    assert status == 2
    assert "look.py is a file: give it with its ending, ./look.py" in err


def test_one_of_ours_by_its_file_is_what_it_is_by_name() -> None:
    root = Path(loading.__file__).resolve().parents[2]
    assert loading.load_procedure(str(root / "procedures" / "spindown" / "procedure.py")) is loading.load_procedure(
        "spindown"
    )


def test_it_takes_plans_limits_and_a_method(bench: Bench) -> None:
    text = small("look-here").replace("step_count=", "method=read_method(__file__), step_count=")
    Path("look.py").write_text(text.replace("Measured, Procedure", "Measured, Procedure, read_method", 1))
    status, _, err = bench("run", "./look.py", *RIG)
    assert status == 2
    assert "method.md: found none; expected the report's method section. Next: write it there, or give" in err
    Path("method.md").write_text("The supply is looked at.\n")
    rig = load_rig("tsbs12")
    Path("mine.toml").write_text(f"{rig.toml_text}\n[plans.look-here]\nseconds = 0.5\n")
    Path("tsbs12.dbc").write_text(rig.dbc_text)
    limit = '{ low = 100.0, high = 110.0, unit = "V", source = "house", verified = true }'
    Path("limits.toml").write_text(f"schema = 1\n[limits.look-here]\nsupply = {limit}\n")
    assert "plans.look-here" not in bench("check", "mine.toml")[2]
    status, out, err = bench("run", "./look.py", "--rig", "mine.toml", "--spec", "limits.toml")
    assert status == 1, err
    run, record = record_of(out)
    assert record["plan"]["seconds"] == 0.5
    assert "The supply is looked at." in (run / "report.html").read_text()


def test_files_beside_the_rig_are_listed_and_not_executed(bench: Bench) -> None:
    rig = load_rig("tsbs12")
    Path("mine.toml").write_text(rig.toml_text)
    Path("tsbs12.dbc").write_text(rig.dbc_text)
    Path("look.py").write_text(small("look-here") + "\nopen('executed', 'w').close()\n")
    Path("script.py").write_text("open('executed', 'w').close()\n")
    status, out, _ = bench("list", "--rig", "mine.toml")
    assert status == 0
    assert "in files beside it, not looked into (`bench check mine.toml FILE` does):\n  look.py  look-here\n" in out
    assert "script.py" not in out
    assert not Path("executed").exists()
    status, out, err = bench("check", "mine.toml", "look.py")
    assert (status, "can run look.py" in out) == (0, True), err
    assert Path("executed").exists()


@given(data=st.binary(max_size=300), begin=st.sampled_from([b"", b"procedure = ", b"procedure: X = Y(name='a', "]))
def test_whatever_lies_beside_a_rig_is_read_without_harm(
    data: bytes, begin: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("beside")
    (folder / "any.py").write_bytes(begin + data)
    rig = load_rig("tsbs12").model_copy(update={"path": str(folder / "rig.toml")})
    for path, name in loading.beside(rig):
        assert path.name == "any.py"
        assert isinstance(name, str)
