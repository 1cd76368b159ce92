"""Rig files as they should be: the shipped one, what may be left out, schemas and migration, files that cannot be read."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from bench.errors import ConfigError, InterlockError, Problem
from bench.rigfile import RigFile, load_rig, text
from bench.rigfile.check import check_rig
from bench.rigfile.envelope import Envelope
from bench.samples import SampleBlock

RIGS = Path(__file__).resolve().parent.parent / "rigs"
TOML = (RIGS / "tsbs12.toml").read_text(encoding="utf-8")
DBC = (RIGS / "tsbs12.dbc").read_text(encoding="utf-8")
OF_LEVERS = ("lever_", "left =", "right =", "motor_to_", '"geometry/motor_to_')
SPAN = 'amb_span = { value = 125.0, unit = "mm", u = 0.05, distribution = "normal", source = "certificate SIM-L-102" }'


def changed(text: str, *changes: tuple[str, str]) -> str:
    for old, new in changes:
        assert text.count(old) >= 1, old
        text = text.replace(old, new, 1)
    return text


def of_schema_1(toml: str) -> str:
    """One of the shipped rigs as schema 1 had it: without the tables of its machine and of its controller."""
    begin = toml.index("# The machine (docs")
    end = min(toml.index(f"\n[{table}]\n") + 1 for table in ("masses", "sensors") if f"\n[{table}]\n" in toml)
    machine = toml[:begin] + toml[end:]
    begin, end = machine.index("[capabilities]"), machine.index("[parameters]")
    return changed(machine[:begin] + machine[end:], ("schema = 2", "schema = 1"))


def written(folder: Path, toml: str = TOML, dbc: str = DBC) -> str:
    (folder / "tsbs12.dbc").write_text(dbc, encoding="utf-8")
    (folder / "rig.toml").write_text(toml, encoding="utf-8")
    return str(folder / "rig.toml")


def problems(folder: Path, toml: str = TOML, dbc: str = DBC) -> dict[str, Problem]:
    """The problems by key; loading must refuse the rig for the same reasons."""
    path = written(folder, toml, dbc)
    found, _ = check_rig(path)
    with pytest.raises(ConfigError) as caught:
        load_rig(path)
    if caught.value.problems:
        assert {p.key for p in caught.value.problems} <= {p.key for p in found}
    for p in found:
        assert p.file
        assert p.found
        assert p.expected
    return {p.key: p for p in found}


def test_the_shipped_rig_has_no_problem_and_is_si() -> None:
    found, load = check_rig("tsbs12")
    assert found == ()
    assert load is not None
    assert 0.1 < load.total < 0.3
    rig = load_rig("tsbs12")
    assert rig.geometry["hook_to_outboard"].value == pytest.approx(0.150, rel=1e-14)
    assert rig.geometry["hook_to_outboard"].standard_uncertainty == pytest.approx(5e-5, rel=1e-14)
    assert rig.geometry["motor_stiffness"].unit == "N/m"
    assert rig.geometry["motor_stiffness"].value == pytest.approx(242.6e3, rel=1e-14)
    assert rig.masses["M4"].standard_uncertainty == pytest.approx(0.3e-3 / 2, rel=1e-14)  # U is given at k = 2
    assert rig.mass_density.standard_uncertainty == pytest.approx(140 / 3**0.5, rel=1e-14)


def test_a_rig_may_have_no_lever_and_no_intervals(tmp_path: Path) -> None:
    """What only some procedures need is theirs to ask for; calibrations hold for a time that a table may state."""
    plain = "\n".join(line for line in TOML.splitlines() if not line.startswith(OF_LEVERS))
    assert check_rig(written(tmp_path, plain))[0] == ()
    rig = RigFile.parse(TOML, DBC)
    assert rig.calibration.interval_days.get("amb-calibration", 365) == 365
    assert rig.machine["ring_inertia"].standard_uncertainty == pytest.approx(1e-5)
    rig = RigFile.parse(TOML + "\n[calibration]\ninterval_days = { force-constant = 90 }\n", DBC)
    assert rig.calibration.interval_days == {"force-constant": 90}


def test_a_rig_on_which_nothing_hangs_needs_neither_hook_nor_hanger(tmp_path: Path) -> None:
    hung = (
        "hanger =",
        "mass_density =",
        "hook_seat =",
        "max_hung_kg =",
        "hook_to_outboard =",
        "M1 =",
        "M2 =",
        "M3 =",
        "M4 =",
        "hook = {",
    )
    bare = "\n".join(line for line in TOML.splitlines() if not line.startswith(hung))
    assert check_rig(written(tmp_path, bare))[0] == ()
    rig = RigFile.parse(bare, DBC)
    assert (rig.hanger.value, rig.envelope.max_hung_kg) == (0, 0)
    with pytest.raises(InterlockError):
        Envelope(rig).check_load("M1")
    bare = of_schema_1(bare)
    motorless = changed(
        bare,
        ('"levitation", "rotation"', '"levitation"'),
        ("com_to_motor = { value = 122,", "axial_gap = { value = 0.7,"),
    )
    assert check_rig(written(tmp_path, motorless))[0] == ()
    found = check_rig(
        written(tmp_path, changed(bare, ("com_to_motor = { value = 122,", "axial_gap = { value = 0.7,")))
    )[0]
    assert [p.key for p in found] == ["geometry.com_to_motor"]
    lengths = (
        "amb_span",
        "com_to_outboard_amb",
        "com_to_inboard_amb",
        "com_to_outboard_sensor",
        "com_to_inboard_sensor",
    )
    table = motorless.split("[geometry]")[1].split("[machine]")[0]
    kept = [line for line in table.splitlines() if not line.startswith(lengths)]
    assert check_rig(written(tmp_path, motorless.replace(table, "\n".join([*kept, ""]))))[0] == ()
    one = [line for line in table.splitlines() if not line.startswith(lengths[1:])]
    found = check_rig(written(tmp_path, motorless.replace(table, "\n".join([*one, ""]))))[0]
    assert {p.key for p in found} == {f"geometry.{name}" for name in lengths[1:]}


def test_protected_positions_are_those_that_the_rig_file_names(tmp_path: Path) -> None:
    named = changed(TOML, ('positions = ["pos_xi", "pos_yi", "pos_xo", "pos_yo"]', 'positions = ["pos_z"]'))
    assert check_rig(written(tmp_path, named))[0] == ()
    rig = RigFile.parse(named, DBC)
    levitated = next(code for code, name in rig.choices("state").items() if name == "LEVITATED")
    columns = {name: np.zeros(1) for name in rig.channels}
    columns |= {"state": np.array([float(levitated)]), "supply": np.array([148.0])}
    for name, refused in (("pos_z", True), ("pos_yi", False)):
        block = SampleBlock("x", 0, np.array([10], np.uint64), np.array([0]), 0, 0, columns | {name: np.array([2e-4])})
        with pytest.raises(InterlockError, match="pos_z") if refused else nullcontext():
            Envelope(rig).check_block(block)
    wrong = check_rig(written(tmp_path, named.replace('["pos_z"]', '["pos_q"]')))[0]
    assert [(p.key, p.found) for p in wrong] == [("envelope.positions", "pos_q")]


def test_the_digest_is_of_both_texts() -> None:
    one = RigFile.parse(TOML, DBC).digest
    assert one == RigFile.parse(TOML, DBC).digest
    assert one != RigFile.parse(TOML + "\n# a comment\n", DBC).digest
    assert one != RigFile.parse(TOML, DBC + "\n").digest


def test_a_rig_file_is_frozen() -> None:
    rig = load_rig("tsbs12")
    with pytest.raises(ValueError, match="frozen"):
        rig.name = "other"


@pytest.mark.parametrize(
    ("schema", "message"),
    [
        ("schema = 3", "schema: found 3; expected 2; it was written for a newer Levbench"),
        ('schema = "1"', "schema: found '1'; expected 2"),
        ("", "schema: found None; expected 2"),
        ("schema = 0", "schema: found 0; no way from there to 2"),
    ],
)
def test_another_schema_is_refused(tmp_path: Path, schema: str, message: str) -> None:
    path = written(tmp_path, changed(TOML, ("schema = 2", schema)))
    with pytest.raises(ConfigError) as caught:
        load_rig(path)
    assert message in str(caught.value)
    found, load = check_rig(path)
    assert len(found) == 1
    assert load is None


def test_an_older_schema_is_migrated_step_by_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def renamed(data: dict[str, object]) -> dict[str, object]:
        return {("title" if k == "heading" else k): v for k, v in data.items()}

    def rounded(data: dict[str, object]) -> dict[str, object]:
        assert data["schema"] == 2
        return {**data, "title": f"{data['title']}!"}

    monkeypatch.setattr(text, "SCHEMA", 3)
    monkeypatch.setattr(text, "MIGRATIONS", {1: renamed, 2: rounded})
    rig = load_rig(written(tmp_path, changed(of_schema_1(TOML), ('title = "Toothless', 'heading = "Toothless'))))
    assert rig.schema_ == 3
    assert rig.title.startswith("Toothless self-bearing")
    assert rig.title.endswith("!")
    monkeypatch.setattr(text, "MIGRATIONS", {1: renamed})
    with pytest.raises(ConfigError, match="found 2; no way from there to 3"):
        load_rig(written(tmp_path, of_schema_1(TOML)))


def test_an_unknown_rig_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"unknown rig 'tsbs13'; expected one of: .*Did you mean tsbs12\?"):
        check_rig("tsbs13")


def test_files_that_cannot_be_read_are_one_clear_error(tmp_path: Path) -> None:
    path = Path(written(tmp_path))
    (tmp_path / "tsbs12.dbc").unlink()
    with pytest.raises(ConfigError, match=r"dbc: cannot read .*tsbs12\.dbc: .*No such file"):
        check_rig(str(path))
    path.write_text(changed(TOML, ('dbc = "tsbs12.dbc"', "")), encoding="utf-8")
    with pytest.raises(ConfigError, match="links: found no dbc"):
        check_rig(str(path))
    path.write_text("name = tsbs12", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"rig\.toml: not TOML: .*line 1"):
        check_rig(str(path))
    path.write_bytes(b"name = '\xff'")
    with pytest.raises(ConfigError, match=r"rig\.toml: byte 8 is not UTF-8"):
        check_rig(str(path))
