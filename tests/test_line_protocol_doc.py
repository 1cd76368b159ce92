"""docs/reference/line-protocol.md: dialogues are held against the simulated firmware, bytes and tables against the code."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from bench.rigfile.commandline import CommandLine
from bench.wire.commandline import block
from sim_backend.machines.lira.device import BANNER, Device
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.plant import FAULTS, STATES, Plant
from sim_backend.machines.lira.shell import ERRORS

PAGE = Path(__file__).resolve().parent.parent / "docs/reference/line-protocol.md"
TEXT = PAGE.read_text(encoding="utf-8")
DIALOGUES = [b for b in re.findall(r"```text\n(.*?)```", TEXT, re.DOTALL) if b.startswith("> ")]


def device() -> Device:
    made = Device(Plant(PlantParams(), 1))
    made.shell.feed(b"\n\necho off\nprompt off\n")
    return made


def section(title: str) -> str:
    return TEXT.split(f"## {title}\n")[1].split("\n## ")[0]


@pytest.mark.parametrize("dialogue", DIALOGUES)
def test_dialogues(dialogue: str) -> None:
    shell, said = device().shell, []
    for line in dialogue.splitlines():
        if line.startswith("> "):
            assert not said
            said = shell.feed(f"{line[2:]}\n".encode()).decode().splitlines()
        else:
            assert line == f"< {said.pop(0)}"
    assert not said


def test_there_are_dialogues() -> None:
    assert len(DIALOGUES) == 3


def test_the_block_by_its_bytes() -> None:
    (shown,) = re.findall(r"```hex\n(.*?)\n```", TEXT)
    assert bytes.fromhex(shown) == block(3, 4096, bytes.fromhex("0100 FEFF 2C01 0080"))


def test_every_verb_is_there_and_no_other() -> None:
    rows = [row.split("|")[1] for row in section("Verbs").splitlines() if row.startswith("| `")]
    assert sorted(re.findall(r"`(\w+)`", "".join(rows))) == sorted(device().verbs)


def test_errors_states_faults_and_keys() -> None:
    rows = [row.split("|")[1:3] for row in section("Lines").splitlines() if re.match(r"\| \d", row)]
    assert {int(code): text.strip() for code, text in rows} == ERRORS
    assert all(re.search(rf"\b{name}\b", section("Verbs")) for name in (*STATES, *FAULTS[1:]))
    assert BANNER in section("Verbs")
    told = re.findall(
        r"`(\w+)`",
        "".join(r.split("|")[1] for r in section("How Levbench says its messages").splitlines()[2:] if "|" in r),
    )
    assert set(told) - {"commandline"} == set(CommandLine.model_fields)
