"""The commands for what is stored: runs and calibrations. Declarations like those of `__main__`, which takes them up."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import Calibrations, Out, ProcedureFile, RunArgument, Table, Verbose


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

    return adopt_command(run, rig, calibrations, anyway, procedure)


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
    from bench.cli.runs import analyse_command

    return analyse_command(run, verbose, procedure)


def report(run: RunArgument, procedure: ProcedureFile = "") -> int:
    """Build the report of a stored run again."""
    from bench.cli.runs import report_command

    return report_command(run, procedure)


def runs(out: Out = Path("runs")) -> int:
    """List the runs with their outcomes."""
    from bench.cli.runs import runs_command

    return runs_command(out)


def export(
    run: RunArgument,
    to: Annotated[Table, typer.Option("--to", help="File format of the tables.")] = Table.PARQUET,
    procedure: ProcedureFile = "",
) -> int:
    """Write the channels, results and figures of a run as tables.

    One file per stream and per figure, in RUN/export.
    """
    from bench.cli.export import export_command

    return export_command(run, to.value, procedure)
