"""The bias of a calibration on a rig whose plans do not say it, and what is said of one that the envelope refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.cli.__main__ import main
from bench.cli.loading import load_procedure
from bench.procedure.plans import assemble
from bench.rigfile import load_rig

STAND = Path(__file__).resolve().parents[2] / "examples/plain-stand/stand.toml"


def stand(folder: Path, bias: str = "") -> str:
    """The plain stand whose plan has this line for its bias."""
    text = STAND.read_text(encoding="utf-8")
    assert "\nbias_A = 1.5\n" in text
    (folder / "stand.toml").write_text(text.replace("\nbias_A = 1.5\n", f"\n{bias}\n"), encoding="utf-8")
    (folder / "stand.dbc").write_bytes(STAND.with_name("stand.dbc").read_bytes())
    return str(folder / "stand.toml")


def test_the_bias_is_the_rigs_own_by_default(tmp_path: Path) -> None:
    procedure = load_procedure("amb-calibration")
    for name, bias in ((stand(tmp_path), 1.5), ("tsbs12", 3.0)):
        assert assemble(procedure.plan, procedure.defaults(load_rig(name))).model_dump()["bias_A"] == bias


def test_a_bias_that_is_refused_is_told_with_its_setting(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(("check", stand(tmp_path, "bias_A = 3.0")))
    said = " ".join(capsys.readouterr().out.split())
    assert "found 3 A; the envelope allows 0.2 to 1.7 A" in said
    assert "bias_A of the plan: set it in [plans.amb-calibration] of the rig file" in said
    assert main(("check", stand(tmp_path))) == 0
    assert "the envelope allows" not in capsys.readouterr().out
