"""Rig files drawn for other laboratories are rig files: nothing is wrong with them but what their machines cannot do."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.cli.abilities import abilities
from bench.rigfile import load_rig
from bench.rigfile.check import check_rig
from benchmarks.drawn_rigs import EXAMPLES, LOOPS, drawn, write


@pytest.mark.parametrize("number", [0, 1, 2, LOOPS])
@pytest.mark.parametrize("example", EXAMPLES)
def test_a_drawn_rig_is_a_rig(example: str, number: int, tmp_path: Path) -> None:
    path = write(example, number, tmp_path)
    assert check_rig(str(path))[0] == ()
    assert "step" in {a.procedure for a in abilities(load_rig(str(path))) if a.able}
    assert drawn(example, number) == path.read_text(encoding="utf-8")
    assert drawn(example, number) != drawn(example, number + 1)
