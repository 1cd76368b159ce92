"""What installed packages add: listed, run, and where something is wrong one message that names the package."""

from __future__ import annotations

import json
import re
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from in_process import Bench, bench_in_process
from packages import install, small

from bench import catalogue, extensions
from bench.errors import ConfigError
from bench.rigfile import load_rig
from sim_backend.machines.table import machine_of

PROCEDURES, MACHINES = "levbench.procedures", "levbench.machines"


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder on `sys.path` that packages are put into; modules that come from there are forgotten afterwards."""
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    yield folder
    for name in [name for name in sys.modules if name.startswith("lev_")]:
        del sys.modules[name]


@pytest.fixture
def bench(site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Bench:
    monkeypatch.chdir(tmp_path)
    return bench_in_process(capsys)


def test_a_package_is_listed_without_being_imported_and_run(bench: Bench, site: Path) -> None:
    install(site, "lev-look", {PROCEDURES: {"look-out": "lev_look:procedure"}}, {"lev_look": small("look-out")})
    status, out, err = bench("list")
    assert (status, err) == (0, "")
    assert re.search(r"^  look-out +of the package lev-look 1\.2$", out, re.MULTILINE)
    assert "lev_look" not in sys.modules
    status, out, err = bench("run", "look-out", "--rig", "tsbs12", "--no-report")
    assert status == 0, err
    run = Path(out.splitlines()[-1])
    record = json.loads((run / "record.json").read_text())
    assert (record["procedure"], record["versions"]["lev-look"]) == ("look-out", "1.2")
    status, out, err = bench("analyse", str(run))
    assert status == 0, err
    again = json.loads((Path(out.strip()) / "record.json").read_text())
    assert again["measurements"] == record["measurements"]
    assert again["versions"]["lev-look"] == "1.2"


def test_a_run_of_a_package_that_is_gone_says_what_to_install(
    bench: Bench, site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(site, "lev-look", {PROCEDURES: {"look-out": "lev_look:procedure"}}, {"lev_look": small("look-out")})
    _, out, _ = bench("run", "look-out", "--rig", "tsbs12", "--no-report")
    monkeypatch.setattr(sys, "path", [p for p in sys.path if p != str(site)])
    status, _, err = bench("analyse", out.splitlines()[-1])
    assert status == 2
    assert "was made by 'look-out' of the package lev-look 1.2" in err
    assert "Next: `pip install lev-look==1.2`" in err


WRONG = {
    "raises": ("raise RuntimeError('no licence')", "RuntimeError in lev_bad.py:1: no licence"),
    "syntax": ("def (:\n", "SyntaxError: invalid syntax (lev_bad.py, line 1)"),
    "exits": ("import sys; sys.exit(3)", "SystemExit in lev_bad.py:1: 3"),
    "lacks a module": ("import no_such_module", "ModuleNotFoundError in lev_bad.py:1: No module named 'no_such_module'"),
    "lacks it": ("", "AttributeError: module 'lev_bad' has no attribute 'procedure'"),
    "no procedure": ("procedure = 3", "found a int; expected a bench.procedure.procedure.Procedure"),
    "another name": (small("other"), "found the name 'other' in it; expected that of its entry point"),
    "half made": (small("bad").replace("measured=measured,", ""), "missing 1 required positional argument: 'measured'"),
    "wrong fields": (small("bad").replace("plan=Plan", "plan=3"), "plan: found 3; expected a class that is a BenchPlan"),
    "no state": (small("bad").replace("RigState.LEVITATED", "'up'"), "state: found 'up'; expected a RigState"),
}  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG)
def test_a_broken_procedure_is_one_message_that_names_the_package(bench: Bench, site: Path, wrong: str) -> None:
    text, expected = WRONG[wrong]
    install(site, "lev-bad", {PROCEDURES: {"bad": "lev_bad:procedure"}}, {"lev_bad": text})
    status, _, err = bench("run", "bad", "--rig", "tsbs12")
    assert status == 2
    assert err.startswith("bench: procedure 'bad' of lev-bad 1.2 (lev_bad:procedure)")
    assert expected in err
    assert "Traceback" not in err
    assert not Path("runs").exists()


def test_a_broken_procedure_stops_no_other(bench: Bench, site: Path) -> None:
    install(
        site, "lev-bad", {PROCEDURES: {"bad": "lev_bad:procedure"}}, {"lev_bad": "raise RuntimeError('no licence')"}
    )
    raising = small("odd").replace("step_count=", "requires=lambda rig: rig.nothing, step_count=")
    install(site, "lev-odd", {PROCEDURES: {"odd": "lev_odd:procedure"}}, {"lev_odd": raising})
    status, out, err = bench("list", "--rig", "tsbs12")
    said = " ".join(out.split())
    assert (status, err) == (0, "")
    assert "amb-calibration yes" in said
    assert "bad no: procedure 'bad' of lev-bad 1.2 (lev_bad:procedure) cannot be loaded: RuntimeError" in said
    assert "odd no: procedure 'odd' of lev-odd 1.2 (lev_odd:procedure): AttributeError in lev_odd.py:" in said
    assert bench("check", "tsbs12", "amb-calibration")[0] == 0
    status, _, err = bench("run", "odd", "--rig", "tsbs12")
    assert status == 2
    assert "procedure 'odd' of lev-odd 1.2 (lev_odd:procedure): AttributeError" in err


def test_a_name_of_ours_is_taken_twice(bench: Bench, site: Path) -> None:
    install(site, "lev-thief", {PROCEDURES: {"spindown": "lev_thief:procedure"}}, {"lev_thief": small("spindown")})
    both = "found levbench (procedures.spindown.procedure) and lev-thief 1.2 (lev_thief:procedure)"
    for command in (("run", "spindown", "--rig", "tsbs12"), ("list",), ("check", "tsbs12", "spindown")):
        status, _, err = bench(*command)
        assert status == 2
        assert f"procedure 'spindown' is taken twice: {both}; expected one owner of a name" in " ".join(err.split())
    assert "lev_thief" not in sys.modules
    assert bench("check", "tsbs12", "amb-calibration")[0] == 0


def test_two_packages_with_one_name(bench: Bench, site: Path) -> None:
    for package in ("lev-one", "lev-two"):
        module = package.replace("-", "_")
        install(site, package, {PROCEDURES: {"twin": f"{module}:procedure"}}, {module: small("twin")})
    status, _, err = bench("run", "twin", "--rig", "tsbs12")
    assert status == 2
    assert "lev-one 1.2 (lev_one:procedure)" in err
    assert "lev-two 1.2 (lev_two:procedure)" in err
    status, out, _ = bench("list")
    assert status == 2
    assert "\n  twin " not in out


def test_metadata_that_cannot_be_read_are_named(bench: Bench, site: Path) -> None:
    install(site, "lev-torn", {}, {})
    torn = site / "lev_torn-1.2.dist-info" / "entry_points.txt"
    torn.write_text("[levbench.procedures]\nthis line is none\n")
    status, out, err = bench("list")
    assert status == 2
    assert str(torn.parent) in err
    assert "cannot be read" in err
    assert "  amb-calibration " in out


@given(text=st.text(alphabet="[]=:. \n\tabclevbench-pou", max_size=200))
def test_no_metadata_raise(text: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("site")
    install(folder, "lev-any", {}, {})
    (folder / "lev_any-1.2.dist-info" / "entry_points.txt").write_text("[levbench.procedures]\n" + text)
    before = list(sys.path)
    try:
        sys.path.insert(0, str(folder))
        for point in extensions.points(extensions.PROCEDURES):
            assert point.package == "lev-any"
        catalogue.procedures()
    finally:
        sys.path[:] = before


def test_a_distribution_that_lies_there_twice_counts_once(
    site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder, version in ((site, "1.2"), (tmp_path / "older", "1.1")):
        install(folder, "lev-look", {PROCEDURES: {"look-out": "lev_look:procedure"}}, {}, version)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path / "older")])
    assert [p.version for p in extensions.points(PROCEDURES)] == ["1.2"]


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [("tsbs", "", "machine 'tsbs' is taken twice: found levbench (sim_backend.machines.table) and lev-m 1.2 (lev_m:M)"),
     ("twin", "", "machine 'twin' is taken twice: found levbench (sim_backend.machines.table) and lev-m 1.2 (lev_m:M)"),
     ("mine", "raise OSError('no core')", "machine 'mine' of lev-m 1.2 (lev_m:M) cannot be loaded: OSError in lev_m.py:1"),
     ("mine", "M = 'me'", "machine 'mine' of lev-m 1.2 (lev_m:M): found a str; expected a sim_backend.machine.Machine"),
     ("mine", "from sim_backend.machines.tsbs.machine import TSBS as M", "found the name 'tsbs' in it"),
     ("mine", "from dataclasses import replace\nfrom sim_backend.machines.tsbs.machine import TSBS\n"
      "M = replace(TSBS, name='mine', stated=lambda rig: rig.nothing)",
      "machine 'mine' of lev-m 1.2 (lev_m:M): AttributeError"),
    ],
)  # fmt: skip
def test_a_machine_of_a_package_that_cannot_be(bench: Bench, site: Path, name: str, text: str, expected: str) -> None:
    install(site, "lev-m", {MACHINES: {name: "lev_m:M"}}, {"lev_m": text})
    rig = load_rig("tsbs12")
    text = rig.toml_text.replace('machine = "tsbs"', f'machine = "{name}"', 1)
    Path("mine.toml").write_text(text)
    Path("tsbs12.dbc").write_text(rig.dbc_text)
    status, _, err = bench("run", "amb-calibration", "--rig", "mine.toml", "--no-report")
    assert status == 2
    assert expected in err
    assert "Traceback" not in err


def test_a_machine_of_a_package_is_simulated(site: Path) -> None:
    text = "from dataclasses import replace\nfrom sim_backend.machines.tsbs.machine import TSBS\nM = replace(TSBS, name='mine')"
    install(site, "lev-m", {MACHINES: {"mine": "lev_m:M"}}, {"lev_m": text})
    rig = load_rig("tsbs12")
    machine = machine_of(rig.model_copy(update={"simulation": {**rig.simulation, "machine": "mine"}}))
    assert machine.name == "mine"
    with pytest.raises(ConfigError, match=r"expected one of .*twin, mine"):
        machine_of(rig.model_copy(update={"simulation": {**rig.simulation, "machine": "mime"}}))


LINK = """
from bench.rigfile import linkurl
from drivers.wires import LinkKind, open_wire


def open_it(spec, name, identifiers, now_ns):
    inner = linkurl.parse(spec.url).rest
    return open_wire(spec.model_copy(update={"url": f"serial:socket://{inner}"}), name, identifiers, now_ns)


BOXED = LinkKind(open_it)
"""


def on_link(url: str) -> Path:
    """A rig file in the folder, its controller on another link."""
    rig = load_rig("tsbs12")
    Path("tsbs12.dbc").write_text(rig.dbc_text)
    Path("mine.toml").write_text(rig.toml_text.replace("slcan:socket://127.0.0.1:28501", url, 1))
    return Path("mine.toml")


def test_a_link_of_a_package_is_opened(bench: Bench, site: Path) -> None:
    from drivers.wires import PacketWire, open_wire

    status, _, err = bench("check", str(on_link("boxed:127.0.0.1:1")))
    assert status == 2
    assert "found scheme 'boxed'" in err
    install(site, "lev-box", {"levbench.links": {"boxed": "lev_box:BOXED"}}, {"lev_box": LINK})
    extensions._read.cache_clear()  # metadata are read once in a process
    path = on_link("boxed:127.0.0.1:2")
    assert bench("check", str(path), "amb-calibration")[0] == 0
    assert "lev_box" not in sys.modules
    with socket.create_server(("127.0.0.1", 0)) as server:
        spec = load_rig(str(path)).link
        wire = open_wire(spec.model_copy(update={"url": f"boxed:127.0.0.1:{server.getsockname()[1]}"}), "controller")
        assert isinstance(wire, PacketWire)
        wire.close()


@pytest.mark.parametrize(
    ("scheme", "text", "expected"),
    [("slcan", LINK, "link 'slcan' is taken twice: found levbench (bench.rigfile.linkurl) and lev-box 1.2 (lev_box:BOXED)"),
     ("boxed", "1 / 0", "link 'boxed' of lev-box 1.2 (lev_box:BOXED) cannot be loaded: ZeroDivisionError in lev_box.py:1"),
     ("boxed", "BOXED = open", "found a builtin_function_or_method; expected a drivers.wires.LinkKind")],
)  # fmt: skip
def test_a_link_of_a_package_that_cannot_be(bench: Bench, site: Path, scheme: str, text: str, expected: str) -> None:
    install(site, "lev-box", {"levbench.links": {scheme: "lev_box:BOXED"}}, {"lev_box": text})
    path = on_link(f"{scheme}:socket://127.0.0.1:1")
    status, _, err = bench("run", "amb-calibration", "--rig", str(path), "--backend", "live", "--operator", "auto")
    assert status == 2
    assert expected in err


def test_a_device_of_a_package_that_has_a_scheme_of_ours(bench: Bench, site: Path) -> None:
    from drivers.modbus import open_lines

    install(site, "lev-bus", {"levbench.devices": {"modbus-tcp": "lev_bus:BUS"}}, {})
    with pytest.raises(ConfigError, match="device 'modbus-tcp' is taken twice"), open_lines(load_rig("tsbs12")):
        pass
