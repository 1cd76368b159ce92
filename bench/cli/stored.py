"""The commands for what is stored: runs and calibrations. Declarations like those of `__main__`, which takes them up."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import Calibrations, Machine, Out, ProcedureFile, RunArgument, Table, Verbose
from bench.run.indexrow import MachineKind
from bench.rundir import LARGEST


def adopt(
    run: RunArgument,
    rig: Annotated[str, typer.Option("--rig", metavar="RIG", help="Default: the rig file the run was made with.")] = "",
    calibrations: Calibrations = None,
    anyway: Annotated[
        bool, typer.Option("--anyway", help="Also a run that is neither PASS nor DONE; the file says so.")
    ] = False,
    procedure: ProcedureFile = "",
) -> int:
    """Make a run's results the rig's current calibration.

    The last line on standard output is its file.
    """
    from bench.cli.adopt import adopt_command
    from bench.cli.meant import ended

    return adopt_command(ended(run), rig, calibrations, anyway, procedure)


def calibrations(
    rig: Annotated[str, typer.Argument(metavar="RIG", help="A rig file, or its name in rigs/.")],
    calibrations: Calibrations = None,
) -> int:
    """List a rig's calibrations with their age and state."""
    from bench.cli.calibrations import calibrations_command

    return calibrations_command(rig, calibrations)


def analyse(run: RunArgument, verbose: Verbose = False, procedure: ProcedureFile = "") -> int:
    """Analyse a stored run again, from its recording alone.

    Writes RUN/analyses/<UTC>/record.json; the original stays as it is.
    """
    from bench.cli.analyse import analyse_command
    from bench.cli.meant import ended

    return analyse_command(ended(run), verbose, procedure)


def report(run: RunArgument, procedure: ProcedureFile = "") -> int:
    """Build the report of a stored run again."""
    from bench.cli.analyse import report_command
    from bench.cli.meant import ended

    return report_command(ended(run), procedure)


def kind_of(machine: Machine | None) -> MachineKind | None:
    """An option's word as the index has it."""
    return None if machine is None else machine.value


def runs(
    out: Out = Path("runs"),
    procedure: Annotated[
        str | None, typer.Option("--procedure", metavar="PROCEDURE", help="Of this procedure alone.")
    ] = None,
    rig: Annotated[str | None, typer.Option("--rig", metavar="RIG", help="Of the rig of this name alone.")] = None,
    failed: Annotated[bool, typer.Option("--failed", help="Those alone that ended neither PASS nor DONE.")] = False,
    last: Annotated[int | None, typer.Option("--last", metavar="N", min=1, help="The newest so many.")] = None,
    show: Annotated[
        list[str] | None, typer.Option("--show", metavar="QUANTITY", help="With this result, such as K_i; repeatable.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False,
    machine: Annotated[Machine | None, typer.Option("--machine", help="Those of such a machine alone.")] = None,
) -> int:
    """List the runs with their outcomes, oldest first."""
    from bench.cli.runs import RunsRequest, runs_command

    return runs_command(RunsRequest(out, procedure, rig, failed, last, tuple(show or ()), as_json, kind_of(machine)))


def show(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the run directories.")] = Path("runs"),
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Of the page; default any free one.")] = 0,
    bind: Annotated[
        str, typer.Option("--bind", metavar="ADDR", help="Address of the page; default this computer alone.")
    ] = "127.0.0.1",
) -> int:
    """Show the runs of a folder on a page. Results, reports and trends; its address is printed.

    Changes nothing; ends on Ctrl-C.
    """
    from bench.cli.live import PageRequest
    from bench.cli.show import show_command

    return show_command(folder, PageRequest(port, bind))


def compare(
    a: Annotated[
        str, typer.Argument(metavar="A", help="A run directory, a run's name or its beginning, last, last~1.")
    ],
    b: Annotated[str, typer.Argument(metavar="B", help="Another one, of the same procedure.")],
    out: Out = Path("runs"),
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Every quantity, and more of each budget.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False,
) -> int:
    """Compare two runs, quantity by quantity. The difference B - A of each, what they share removed.

    |E_n| beyond 1: the 95 % interval of the difference leaves 0 out.
    """
    from bench.cli.compare import CompareRequest, compare_command

    return compare_command(CompareRequest((a, b), out, verbose, as_json))


def trend(
    quantity: Annotated[str, typer.Argument(metavar="QUANTITY", help="A name of results, as K_i or K@inboard.")],
    rig: Annotated[
        str | None, typer.Option("--rig", metavar="RIG", help="Only runs of this rig, as records name it.")
    ] = None,
    procedure: Annotated[
        str | None, typer.Option("--procedure", metavar="PROCEDURE", help="Only runs of this procedure.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, max=LARGEST, help="Only runs of this virtual machine.")
    ] = None,
    machine: Annotated[
        Machine | None,
        typer.Option("--machine", help="Only runs of such a machine; default real, where there are any."),
    ] = None,
    out: Out = Path("runs"),
    last: Annotated[int, typer.Option("--last", metavar="N", min=2, help="The newest N runs.")] = 100,
    weight: Annotated[float, typer.Option("--lambda", help="Weight of the newest value in the EWMA.")] = 0.2,
    baseline: Annotated[
        int, typer.Option("--baseline", metavar="N", help="First runs of a segment that make its limits.")
    ] = 8,
    json: Annotated[bool, typer.Option("--json", help="As data, for programs.")] = False,
    figure: Annotated[Path | None, typer.Option("--figure", metavar="FILE", help="Also draw it, as SVG.")] = None,
) -> int:
    """Follow a quantity over the runs of a folder. Control charts, drift, and when its limit is near."""
    from bench.cli.trend import TrendRequest, trend_command

    asked = TrendRequest(quantity=quantity, out=out, rig=rig, procedure=procedure, seed=seed, last=last, weight=weight,
                         baseline=baseline, json=json, figure=figure, machine=kind_of(machine))  # fmt: skip
    return trend_command(asked)


def export(
    run: RunArgument,
    to: Annotated[Table, typer.Option("--to", help="File format of the tables.")] = Table.PARQUET,
    procedure: ProcedureFile = "",
) -> int:
    """Write the channels, results and figures of a run as tables.

    One file per stream and per figure, in RUN/export.
    """
    from bench.cli.export import export_command
    from bench.cli.meant import ended

    return export_command(ended(run), to.value, procedure)
