"""Rig files and DBCs that a stranger wrote: refused by key, in little time and memory, and never quoted."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_rigfile import DBC, TOML, changed, problems, written

from bench.cli.campaign.dask import packed
from bench.errors import ConfigError
from bench.inputfile import DEPTH, TomlError, parse_toml
from bench.rigfile import load_rig, read_rig
from bench.rigfile.check import check_rig
from bench.rigfile.messages import load_messages
from bench.units import KNOWN, UNITS

ROOT = Path(__file__).resolve().parent.parent
DBC_LINE = 'dbc = "tsbs12.dbc"'
UTF8 = 'encoding = "utf-8"'


def checked(rig: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "bench.cli", "check", rig]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=ROOT)


def with_mux(signal: str, dbc: str = DBC) -> str:
    """That signal's message with a multiplexer, and the signal as one of those that it chooses from."""
    line = next(x for x in dbc.splitlines() if x.startswith(f" SG_ {signal} :"))
    other = next(x for x in dbc[dbc.index(line) :].splitlines()[1:] if x.startswith(" SG_ "))
    return changed(dbc, (line, line.replace(" :", " m0 :")), (other, other.replace(" :", " M :")))


@pytest.mark.parametrize(
    ("signal", "key", "message"),
    [
        ("pos_xi", "devices.controller.binding.telemetry", "Telemetry"),
        ("token", "devices.controller.binding.commands.ENABLE", "Command"),
    ],
)
def test_a_multiplexed_message_that_is_used_is_refused_with_its_key(
    tmp_path: Path, signal: str, key: str, message: str
) -> None:
    dbc = DBC if signal == "pos_xi" else DBC[DBC.index("BO_ 17 ") :]
    changed_dbc = DBC.replace(dbc, with_mux(signal, dbc))
    found = problems(tmp_path, dbc=changed_dbc)
    assert found[key].found == f"{message}, which is multiplexed"
    done = checked(str(tmp_path / "rig.toml"))
    assert done.returncode == 2
    assert key in done.stderr


def test_a_multiplexed_message_that_nothing_uses_is_accepted(tmp_path: Path) -> None:
    own = (
        'BO_ 1800 Diagnosis: 8 Controller\n SG_ page M : 0|8@1+ (1,0) [0|0] "" Host\n SG_ a m0 : 8|8@1+ (1,0) [0|0] "" Host\n'
        ' SG_ b m1 : 8|8@1+ (1,0) [0|0] "" Host\n\n'
    )
    dbc = DBC.replace("BO_ 17 ", own + "BO_ 17 ", 1)
    assert load_messages(dbc)["Diagnosis"].multiplexed
    assert check_rig(written(tmp_path, dbc=dbc))[0] == ()


@pytest.mark.parametrize(
    ("added", "key"),
    [
        ("deep = " + "[" * 20_000 + "]" * 20_000, "deep"),
        (".".join(["a"] * 50_000) + " = 1", "a.a.a.a"),
        ("[simulation.deep]\nhere = " + "[" * (DEPTH + 1) + "]" * (DEPTH + 1), "simulation.deep.here"),
    ],
)
def test_deep_nesting_is_refused_with_its_key(tmp_path: Path, added: str, key: str) -> None:
    done = checked(written(tmp_path, f"{TOML}\n{added}\n"))
    assert (done.returncode, "found more than 32 levels; expected fewer" in done.stderr) == (2, True), done.stderr
    assert key in done.stderr
    assert len(done.stderr) < 400


@given(st.text(alphabet="a.'\"[]{}=,\n -1", max_size=200) | st.text(max_size=40))
def test_any_text_is_toml_of_bounded_depth_or_refused(text: str) -> None:
    try:
        data = parse_toml(text)
    except TomlError:
        return
    depth, level = 0, [data]
    while level:
        depth += 1
        level = [x for v in level for x in (v.values() if isinstance(v, dict) else v) if isinstance(x, dict | list)]
    assert depth <= DEPTH


def pointed(folder: Path, dbc: str) -> str:
    rig = written(folder, changed(TOML, (DBC_LINE, f'dbc = "{dbc}"')))
    (folder / "tsbs12.dbc").unlink()
    return rig


def test_a_dbc_is_a_regular_file_of_a_bounded_size(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.dbc")
    with (tmp_path / "large.dbc").open("wb") as file:
        file.truncate(16_000_001)  # takes no disk
    for name, found in (
        ("/dev/zero", "found no regular file; expected one"),
        ("pipe.dbc", "found no regular file; expected one"),
        ("large.dbc", "found more than 16000000 bytes; expected a smaller file"),
        ("absent.dbc", "No such file or directory"),
    ):
        with pytest.raises(ConfigError, match=rf"\.dbc: cannot read .*{name}: {found}"):
            read_rig(pointed(tmp_path, name))


def test_what_is_no_dbc_is_refused_without_a_word_of_it(tmp_path: Path) -> None:
    (tmp_path / "rigs").mkdir()
    (tmp_path / "passwords").write_text("root:secret:0:0\n", encoding="utf-8")
    done = checked(pointed(tmp_path / "rigs", "../passwords"))
    assert done.returncode == 2
    assert "../passwords: (file): found wrong syntax at line 1, column 1; expected a usable DBC" in done.stderr
    assert "secret" not in done.stdout + done.stderr


@given(st.text(max_size=60) | st.text(alphabet='BOVALSG_ :|@+-,()[]"0123456789\nsecret', max_size=120))
def test_any_text_is_a_dbc_or_refused_in_words_of_our_own(text: str) -> None:
    said = ""
    try:
        load_messages(f"{text}\nhidden", "a.dbc")
    except ConfigError as error:
        said = str(error)
    assert "hidden" not in said


def test_a_dbc_in_another_encoding_names_the_key(tmp_path: Path) -> None:
    rig = written(tmp_path)
    (tmp_path / "tsbs12.dbc").write_bytes(DBC.encode() + 'CM_ "Gr\u00f6\u00dfe";\n'.encode("cp1252"))
    text = r"\.encoding: found 'utf-8', which byte \d+ of tsbs12\.dbc is not; .*encoding = \"cp1252\""
    with pytest.raises(ConfigError, match=text):
        read_rig(rig)
    Path(rig).write_text(changed(TOML, (UTF8, 'encoding = "cp1252"')), encoding="utf-8")
    assert "Gr\u00f6\u00dfe" in read_rig(rig).dbc
    Path(rig).write_text(changed(TOML, (UTF8, 'encoding = "latin-99"')), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"\.encoding: found 'latin-99'; expected a known one"):
        read_rig(rig)


def test_an_unknown_unit_is_answered_by_the_list(tmp_path: Path) -> None:
    found = problems(tmp_path, changed(TOML, ('125.0, unit = "mm"', '125.0, unit = "inch"')))
    assert (found["geometry.amb_span.unit"].found, found["geometry.amb_span.unit"].expected) == ("'inch'", KNOWN)
    found = problems(tmp_path, dbc=changed(DBC, ('"rad/s"', '"furlong"')))
    assert any(p.expected == KNOWN and "furlong" in p.found for p in found.values())
    found = problems(tmp_path, changed(TOML, ('scale = 0.01, unit = "r/min"', 'scale = 0.01, unit = "r/mim"')))
    (p,) = found.values()
    assert p.key == "devices.drive.registers.target_speed.unit"
    assert (p.found, p.expected) == ("'r/mim'", f"{KNOWN}. Did you mean 'r/min'?")


@pytest.mark.parametrize("symbol", ["1/min", "U/min", "min-1", "°/s", "deg/s"])
def test_a_dbc_may_write_a_speed_as_europe_does(tmp_path: Path, symbol: str) -> None:
    assert check_rig(written(tmp_path, dbc=DBC.replace('"rad/s"', f'"{symbol}"')))[0] == ()


def test_a_grad_is_refused_for_it_is_two_units(tmp_path: Path) -> None:
    said = "a unit that means one thing: write deg or gon (grad is a degree in German, a gon in English)"
    at = DBC.index(" SG_ angle :")
    found = problems(tmp_path, dbc=DBC[:at] + DBC[at:].replace('"rad"', '"Grad"', 1))
    assert [(p.key, p.found, p.expected) for p in found.values()] == [("Telemetry.angle", "unit 'Grad'", said)]
    angle = 'signal = "Telemetry.angle", unit = "rad"'
    found = problems(tmp_path, changed(TOML, (angle, angle.replace('"rad"', '"grad"'))))
    assert (found["channels.angle.unit"].found, found["channels.angle.unit"].expected) == ("'grad'", said)
    assert check_rig(written(tmp_path, dbc=DBC[:at] + DBC[at:].replace('"rad"', '"gon"', 1)))[0] == ()


def test_the_page_has_the_table_of_units() -> None:
    """Row by row what `bench.units` knows: the SI unit, and the symbols of its kind."""
    page = (ROOT / "docs" / "reference" / "rig-file.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| [^|]+ \| `([^`]+)` \| ([^|]+) \|$", page[page.index("## Units") :], flags=re.M)
    listed = {si: re.findall(r"`([^`]+)`", symbols) for si, symbols in rows}
    known: dict[str, list[str]] = {}
    for symbol in KNOWN.removeprefix("a known unit: one of ").split(", "):
        known.setdefault(UNITS[symbol].si, []).append(symbol)
    assert listed == known


def test_only_files_in_the_rigs_own_folder_travel(tmp_path: Path) -> None:
    (tmp_path / "elsewhere.dbc").write_text(DBC, encoding="utf-8")
    folder = tmp_path / "rigs"
    folder.mkdir()
    (folder / "link.dbc").symlink_to(tmp_path / "elsewhere.dbc")
    for name in ("../elsewhere.dbc", "link.dbc", str(tmp_path / "elsewhere.dbc")):
        rig = load_rig(pointed(folder, name))
        with pytest.raises(ConfigError, match="a file in the rig file's folder"):
            packed(rig)
    (folder / "link.dbc").unlink()
    assert packed(load_rig(written(folder))).dbc == DBC.encode()
    for shipped in ("tsbs12", "amb5dof"):  # what a wheel holds
        assert packed(load_rig(shipped)).dbc_name == f"{shipped}.dbc"
