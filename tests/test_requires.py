"""What procedures require of a rig: declared as data, complete, and told when it is not there."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from bench import catalogue
from bench.cli.loading import load_procedure, requires_of
from bench.procedure import Procedure
from bench.rigfile import RigFile, load_rig
from bench.rigfile.capabilities import parameters_named
from bench.rigfile.check_machine import references_in
from bench.rigfile.roles import resolved

OF = {
    "tsbs12": ("amb-calibration", "force-constant", "negative-stiffness", "force-coupling", "torque-constant", "spindown",
               "angle-step", "maximum-speed", "load-balancing", "lift-off", "slew", "force-map"),
    "tsbs6": ("amb-calibration", "torque-constant", "spindown", "angle-step", "slew"),
    "amb5dof": ("spindown", "step", "bearing-model", "tracking", "unbalance", "compensation", "balance", "run-up", "coast-down",
                "sensitivity"),
    "amb1dof": ("derivative", "estimator-compare"),
    "lira": ("loop-response", "unstable-pole", "pull-ratio", "mission", "gate-margin", "actuator-constant", "cogging-map",
             "runout-map", "bearing-constant", "current-step", "encoder-zero", "sensor-delay", "emf-constant", "coil-map"),
    "rlsrm": ("map-zero", "inductance-map", "static-characteristics", "load-response", "positioning", "step-following",
              "sine-following", "axis-friction", "axis-breakaway", "axis-inertia", "decoupling"),
}  # fmt: skip
PROCEDURES = Path(__file__).resolve().parents[1] / "procedures"
PAIRS = [(rig, name) for rig, names in OF.items() for name in names]
TABLES = ("channels", "sensors", "parameters", "geometry", "machine")


@pytest.mark.parametrize("rig", OF)
def test_each_rig_can_run_its_procedures_and_no_others(rig: str) -> None:
    procedures = {entry.name: load_procedure(entry.name) for entry in catalogue.PROCEDURES}
    assert {name for names in OF.values() for name in names} == set(procedures)
    assert tuple(n for n, p in procedures.items() if not p.lacking(load_rig(rig))) == OF[rig]


@pytest.mark.parametrize("example", ["own-controller/plainamb", "one-axis/oneaxis"])
def test_a_rig_of_other_bearings_is_told_what_it_lacks(example: str) -> None:
    """One without certificates and set points, and one of a single axis."""
    rig = load_rig(str(Path(__file__).resolve().parents[1] / "examples" / f"{example}.toml"))
    lacking = {entry.name: load_procedure(entry.name).lacking(rig) for entry in catalogue.PROCEDURES}
    assert (
        lacking["step"]
        == {
            "own-controller/plainamb": (
                "sensors: found no pos_yi, pos_xi, pos_yo, pos_xo, i_xi_p, i_xi_n, i_xo_p, i_xo_n",
                "capabilities: found no set_points",
            ),
            "one-axis/oneaxis": ("bearings: found 1 radial; expected two",),
        }[example]
    )
    assert all(said.partition(":")[0] for lines in lacking.values() for said in lines)


def without(rig: RigFile, table: str, name: str) -> RigFile:
    """The rig without one entry of a table of its file."""
    if table == "roles":
        devices = {
            k: d.model_copy(update={"roles": tuple(r for r in d.roles if r != name)}) for k, d in rig.devices.items()
        }
        return rig.model_copy(update={"devices": devices})
    if table == "capture":
        assert rig.capture is not None
        left = {k: v for k, v in rig.capture.channels.items() if k != name}
        return rig.model_copy(update={"capture": rig.capture.model_copy(update={"channels": left})})
    return rig.model_copy(update={table: {k: v for k, v in getattr(rig, table).items() if k != name}})


def without_capability(rig: RigFile, key: str) -> RigFile:
    """The rig without one; set points are all that there are."""
    content = rig.capabilities.model_dump()
    table, *path = key.split(".")
    holder: dict[str, Any] = content
    for part in (table, *path)[:-1]:
        holder = holder.get(part) or {}
    last = (table, *path)[-1]
    if path[:-1] == ["contact"]:  # the bit of one ring
        del holder[last]
    elif isinstance(holder[last], str):
        holder[last] = ""
        if table == "model":
            del holder[last]
    elif last in ("path", "injection", "motion", "loop_injection", "hold", "coil_map", "positioning", "phase_test"):
        holder[last] = None
    elif key == "set_points" or holder is content or isinstance(holder[last], dict):
        holder[last] = {}
    return rig.model_copy(update={"capabilities": type(rig.capabilities).model_validate(content)})


@pytest.mark.parametrize(("rig", "name"), PAIRS)
def test_whatever_is_taken_away_is_named(rig: str, name: str) -> None:
    procedure, whole = load_procedure(name), load_rig(rig)
    requires = procedure.requires(whole)
    assert requires.channels or requires.parameters
    for table in (f.name for f in fields(requires) if f.name not in ("masses", "lacks", "uses")):
        for one in getattr(requires, table):
            if table == "channels" and "." in one:
                continue  # what stands behind a role: tests/test_roles.py
            if table == "capabilities":
                (said,) = procedure.lacking(without_capability(whole, one))
            else:
                (said,) = procedure.lacking(without(whole, table, one))
            assert one in said
    if requires.masses:
        (said,) = procedure.lacking(whole.model_copy(update={"masses": {}}))
        assert said.startswith("masses")
    if requires.capture:
        (said,) = procedure.lacking(whole.model_copy(update={"capture": None}))
        assert said.startswith("capture")


@pytest.mark.parametrize(("rig", "name"), PAIRS)
def test_a_plan_can_be_checked_with_what_is_declared(rig: str, name: str) -> None:
    """The declaration is complete: no more is looked up before a run, but parameters that the plan names."""
    procedure, whole = load_procedure(name), load_rig(rig)
    plan = procedure.plan.model_validate(whole.plans.get(name, {}))
    named = {*procedure.settings(whole, plan), *plan_parameters(procedure), *bound(whole)}
    by_plan = {
        "parameters": named,
        "machine": {"polar_inertia"} if name == "spindown" else set(),
    }  # else that of a ring
    referred = references_in(whole)  # what the tables of the machine are made of
    kept = {t: {*getattr(procedure.requires(whole), t), *by_plan.get(t, ())} for t in TABLES}
    for table in ("geometry", "machine"):
        kept[table] |= {identity.partition("/")[2] for identity in referred if identity.startswith(f"{table}/")}
    kept["channels"] |= set(resolved(whole, kept["channels"]))
    bare = {t: {k: v for k, v in getattr(whole, t).items() if k in kept[t]} for t in TABLES}
    assert procedure.problems(whole.model_copy(update=bare), plan) == ()


def bound(rig: RigFile) -> set[str]:
    """Parameters that a rig binds to what its controller can do."""
    return {parameter for _, parameter in parameters_named(rig.capabilities)}


def plan_parameters(procedure: Procedure) -> set[str]:
    """Parameters that the default plan of the set-point steps names."""
    plan = procedure.plan()
    if procedure.name != "step":
        return set()
    return {*getattr(plan, "a", {}), *getattr(plan, "b", {}), *getattr(plan, "warm", {}),
            *(f"ref_{a}" for a in getattr(plan, "axes", ()))}  # fmt: skip


def test_what_is_required_is_known_without_numerics() -> None:
    """`requires` of every procedure, on a rig: whatever computes is imported where it computes."""
    code = (
        "import sys\n"
        "from bench import catalogue\n"
        "from bench.cli.loading import load_procedure\n"
        "from bench.rigfile import load_rig\n"
        "rig = load_rig('tsbs12')\n"
        "said = [load_procedure(entry.name).lacking(rig) for entry in catalogue.PROCEDURES]\n"
        "print(len(said), *sorted({'scipy', 'pandas', 'matplotlib', 'can', 'cantools'} & sys.modules.keys()))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(len(catalogue.PROCEDURES))]


def imported(code: str) -> set[str]:
    """Modules of procedures that a fresh Python has after some code."""
    code += "\nimport sys\nprint('\\n', *[name for name in sys.modules if name.startswith('procedures.')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


def test_what_a_procedure_needs_is_imported_without_the_procedure() -> None:
    """`bench list --rig` asks 48 of them, and a rig can do a dozen."""
    rooms = [entry.module.rpartition(".")[0] for entry in catalogue.PROCEDURES]
    found = imported("\n".join(f"import {room}.requires" for room in rooms))
    assert {f"{room}.requires" for room in rooms} <= found
    assert not {f"{room}.procedure" for room in rooms} & found
    assert {name for name in found if name.endswith((".estimates", ".checks", ".figures"))} == set()


@pytest.mark.parametrize("entry", catalogue.PROCEDURES, ids=lambda entry: entry.name)
def test_a_procedure_asks_for_what_its_room_says(entry: catalogue.Entry) -> None:
    assert load_procedure(entry.name).requires is requires_of(entry)


def test_a_live_run_imports_nothing_while_the_machine_moves() -> None:
    """Neither what `acquire` looks at between two runs, nor what evaluates afterwards."""
    code = "from bench.cli.compose import load_all_of as load, load_procedure as named\nload(named('balance'))"
    room = {f"procedures.balance.{path.stem}" for path in (PROCEDURES / "balance").glob("[!_]*.py")}
    assert {"procedures.balance.estimates", "procedures.balance.figures"} < room <= imported(code)


def test_a_room_of_one_file_says_by_its_procedure_what_it_needs(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """As the guide's has no `requires.py`."""
    (tmp_path / "of_one_file").mkdir()
    (tmp_path / "of_one_file" / "procedure.py").write_text(
        "from procedures.step.procedure import procedure as procedure\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    entry = catalogue.Entry("of-one-file", "of_one_file.procedure", "a step")
    assert requires_of(entry) is load_procedure("step").requires


def test_a_listing_imports_no_evaluation_of_what_a_rig_lacks() -> None:
    found = imported("import sys\nfrom bench.cli.abilities import abilities\nfrom bench.rigfile import load_rig\n"
                     "abilities(load_rig('amb1dof'))")  # fmt: skip
    lacking = {entry.module for entry in catalogue.PROCEDURES if entry.name not in OF["amb1dof"]}
    assert not lacking & found
    assert {f"procedures.{name.replace('-', '_')}.procedure" for name in OF["amb1dof"]} <= found
    assert not {f"procedures.{name.replace('-', '_')}.figures" for name in OF["amb1dof"]} & found


@pytest.mark.parametrize("name", ["unbalance", "run-up", "coast-down"])
def test_what_only_captures_show_is_missing_where_there_are_captures(name: str) -> None:
    spindle = load_rig(str(Path(__file__).parent.parent / "examples/vertical-spindle/spindle.toml"))
    for rig, may_lack in ((load_rig("amb5dof"), False), (spindle, True)):
        optional = {q.name for q in load_procedure(name).on(rig).optional}
        assert ({"current_peak", "voltage_peak"} <= optional) is may_lack


def test_tracking_declares_what_a_rig_follows() -> None:
    spindle = load_rig(str(Path(__file__).parent.parent / "examples/vertical-spindle/spindle.toml"))
    rigs = (spindle, load_rig("amb5dof"))
    of_path, of_points = ({q.name for q in load_procedure("tracking").on(rig).optional} for rig in rigs)
    assert "error_peak" in of_path
    assert "error_peak_y" not in of_points
    assert of_points
