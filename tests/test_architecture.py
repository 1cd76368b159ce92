"""The map of the house leads where it says: files and functions that it names exist, and the five jumps from a report's number
back to its bytes go through on a run.
"""

from __future__ import annotations

import ast
import configparser
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest

from bench.cli.compose import Request
from bench.cli.loading import load_procedure
from bench.cli.run import execute
from bench.link.frames import SENT
from bench.procedure import Measured
from bench.recording import Recording
from bench.rigfile.roles import STATUS
from procedures.shared.step_table import reduced
from reports import resultrows

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/explanation/architecture.md").read_text(encoding="utf-8")
JUMPS = PAGE.split("\n## One number of a report")[1].split("\n## ")[0]
CHANNEL = "i_yi_p"


def named() -> list[tuple[str, str]]:
    """Files and what they hold, as the jumps name them."""
    return re.findall(r"`([\w/]+\.py)`\s+`([\w.]+)`", JUMPS)


def defined(file: str) -> set[str]:
    """Functions and classes of a module, and methods as `Class.method`."""
    found = set()
    for node in ast.parse((ROOT / file).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        if isinstance(node, ast.ClassDef):
            found |= {f"{node.name}.{part.name}" for part in node.body if isinstance(part, ast.FunctionDef)}
    return found


def test_there_are_five_jumps_that_name_functions() -> None:
    jumps = re.split(r"\n\d\. ", JUMPS)[1:]
    assert len(jumps) == 5
    assert all(re.search(r"`[\w/]+\.py`\s+`[\w.]+`", jump) for jump in jumps)


@pytest.mark.parametrize(("file", "name"), named())
def test_what_a_jump_names_exists(file: str, name: str) -> None:
    assert name in defined(file)


def test_files_and_folders_that_the_page_names_exist() -> None:
    rooms = "bench|drivers|procedures|reports|sim_backend|rigs|specs|campaigns|tests|benchmarks|examples|docs"
    names = set(re.findall(rf"`((?:{rooms})/[\w./-]*)`", PAGE))
    assert len(names) > 30
    assert [n for n in names if not (ROOT / n).exists()] == []


def test_the_floors_are_those_of_the_contract() -> None:
    contracts = configparser.ConfigParser()
    contracts.read(ROOT / ".importlinter")
    layers = contracts["importlinter:contract:floors"]["layers"].strip().splitlines()
    floors = [{name.strip() for name in layer.split("|")} for layer in layers]
    told = re.findall(r"^\| (\d+) \| `(\w+)` \|", PAGE, re.MULTILINE)
    by_floor = [
        {name for n, name in told if int(n) == floor} for floor in sorted({int(n) for n, _ in told}, reverse=True)
    ]
    assert by_floor == floors
    packages = {p.parent.name for p in ROOT.glob("bench/*/__init__.py")}
    assert {name for _, name in told} == packages


@dataclass(frozen=True)
class Walked:
    """A finished run: its record and its recording."""

    record: dict[str, Any]
    recording: Recording[Any]

    @property
    def entry(self) -> dict[str, Any]:
        """K_i in the record."""
        (entry,) = (m for m in self.record["measurements"] if m["name"] == "K_i")
        return dict(entry)

    @property
    def result(self) -> Any:
        """What the procedure makes of the recording."""
        return load_procedure("amb-calibration").evaluated(self.recording).result[0]


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Walked:
    out = tmp_path_factory.mktemp("runs")
    plan = ("settle_s=0.3", "average_s=0.2")
    done = execute(Request("amb-calibration", "tsbs12", seed=1, plan=plan, out=out, report=False))
    record = json.loads((done.directory / "record.json").read_text(encoding="utf-8"))
    return Walked(record, Recording.open(done.directory / "recording.mcap", load_procedure("amb-calibration").plan))


def test_the_cell_is_the_records_value_rounded(walked: Walked) -> None:
    cell = resultrows.row(walked.entry, {}, {}).result
    found = re.fullmatch(r"\((\d+\.\d+) ± (\d+\.\d+)\)\sN/A", cell)
    assert found is not None, cell
    value, half = walked.entry["value"], walked.entry["expanded_uncertainty"]
    digits = len(found[1].partition(".")[2])
    assert float(found[1]) == round(value, digits)
    assert float(found[2]) == pytest.approx(half, abs=10.0**-digits)


def test_the_records_value_is_what_the_recording_is_evaluated_to(walked: Walked) -> None:
    procedure = load_procedure("amb-calibration")
    (k_i,) = (m for m in procedure.analyse(walked.recording) if isinstance(m, Measured) and m.quantity.name == "K_i")
    assert k_i.estimate.value == walked.entry["value"]
    assert k_i.estimate.value == walked.result.estimates["K_i"].value


def test_the_fit_is_made_of_means_of_steps(walked: Walked) -> None:
    inboard_upper = walked.result.data.hangings.currents[0, 0]
    for turn, (_, steps) in enumerate(walked.recording.steps("hang").by("angle_rad")):
        for point, step in enumerate(steps):
            samples = step.read(CHANNEL, STATUS)
            mean = reduced(samples, (CHANNEL,), step.labels)["mean"][CHANNEL]
            assert mean == pytest.approx(inboard_upper[turn, point], rel=1e-14)


def test_a_step_is_cut_out_of_decoded_blocks(walked: Walked) -> None:
    step = next(iter(walked.recording.steps("hang")))
    columns = [
        block.columns[CHANNEL][(block.t_ns >= step.start_ns) & (block.t_ns < step.end_ns)]
        for block in walked.recording.blocks("telemetry", step.start_ns, step.end_ns)
    ]
    assert np.array_equal(np.concatenate(columns), step.read(CHANNEL)[CHANNEL])


def test_a_decoded_sample_is_what_cantools_reads_from_the_frame(walked: Walked) -> None:
    recording = walked.recording
    message = cantools.database.load_file(ROOT / "rigs/tsbs12.dbc", encoding="utf-8").get_message_by_name("Telemetry")
    step = next(iter(recording.steps("hang")))
    block = next(iter(recording.blocks("telemetry", step.start_ns, step.end_ns)))
    by_tick: dict[int, dict[str, Any]] = {}
    for batch in recording.frames("controller"):
        for frame in batch[(batch["id"] == message.frame_id) & (batch["flags"] & SENT == 0)]:
            read = message.decode(frame["data"][: frame["length"]].tobytes(), decode_choices=False)
            by_tick[int(read["tick"])] = dict(read)
        if block.ticks[-1] in by_tick:
            break
    expected = [by_tick[int(tick)][CHANNEL] for tick in block.ticks]
    assert np.array_equal(block.columns[CHANNEL], np.float32(expected))
