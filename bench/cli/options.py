"""What the commands of `bench` take: choices, and options that several of them share."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from bench.rundir import LARGEST


class Backend(StrEnum):
    """What stands behind the rig's links."""

    SIM = "sim"
    LIVE = "live"


class OperatorKind(StrEnum):
    """Who hangs the masses and answers the questions."""

    CONSOLE = "console"
    AUTO = "auto"


class Table(StrEnum):
    """File formats of `bench export`."""

    PARQUET = "parquet"
    CSV = "csv"
    MCAP = "mcap"
    MDF = "mdf"
    BLF = "blf"
    ASC = "asc"
    CANDUMP = "candump"


class Keep(StrEnum):
    """Which recordings of a campaign over many rigs stay."""

    ALL = "all"
    MISSED = "missed"
    NONE = "none"


class Machine(StrEnum):
    """On what a run was made."""

    REAL = "real"
    SERVED = "served"
    SIMULATED = "simulated"


Out = Annotated[Path, typer.Option("--out", help="Folder of the run directories.")]
Calibrations = Annotated[
    Path | None,
    typer.Option("--calibrations", metavar="DIR", help="Folder of calibrations; default beside the rig file."),
]
Model = Annotated[
    Path | None,
    typer.Option("--model", metavar="FILE", help="The model.json of a campaign, to tell the controller what it has."),
]
Live = Annotated[bool, typer.Option("--live", help="Show what happens on a page; its address is printed.")]
LivePort = Annotated[
    int | None, typer.Option("--live-port", min=0, max=65535, help="Of the live page; default any free one.")
]
LiveBind = Annotated[
    str | None,
    typer.Option(
        "--live-bind", metavar="ADDR", help="Address of the live page; default 127.0.0.1, this computer alone."
    ),
]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="Say every result and every note, not only what was judged.")
]
ProcedureFile = Annotated[
    str,
    typer.Option(
        "--procedure", metavar="FILE", help="The file of the procedure, if the run was made by one in a file."
    ),
]
RunArgument = Annotated[
    str, typer.Argument(metavar="RUN", help="A run directory; in ./runs a run's name or its beginning, last, last~1.")
]
RigArgument = Annotated[str, typer.Argument(metavar="RIG", help="A rig file, or its name in rigs/.")]
RigOption = Annotated[str, typer.Option("--rig", metavar="RIG", help="A rig file, or its name in rigs/.")]
Seed = Annotated[int | None, typer.Option(min=0, max=LARGEST, help="Which virtual rig (simulation only; default 0).")]
Visit = Annotated[
    int | None,
    typer.Option(min=0, max=LARGEST, help="Another day of the same virtual rig (simulation only; default 0)."),
]
Plans = Annotated[list[str] | None, typer.Option("--plan", metavar="KEY=VALUE", help="A setting; repeatable.")]
PlanFile = Annotated[Path | None, typer.Option("--plan-file", help="Settings from a TOML file.")]
Truth = Annotated[
    list[str] | None, typer.Option("--truth", metavar="KEY=VALUE", help="Fix what the simulator draws; repeatable.")
]
Links = Annotated[
    list[str] | None, typer.Option("--link", metavar="NAME=URL", help="Another address for a link; repeatable.")
]
Faults = Annotated[list[str] | None, typer.Option("--fault", metavar="FAULT", help="A fault to inject; repeatable.")]
ClearFault = Annotated[bool, typer.Option("--clear-fault", help="Clear a fault that an earlier run left (live only).")]
Operator = Annotated[OperatorKind | None, typer.Option(help="Default: auto in simulation, console on a terminal.")]
GoOn = Annotated[
    str | None, typer.Option("--continue", metavar="RUN", help="Go on with a run that was stopped, as it was begun.")
]
NoReport = Annotated[bool, typer.Option("--no-report", help="Leave the report out.")]
AllowExpired = Annotated[
    bool, typer.Option("--allow-expired", help="Use calibrations that are overdue; the report says so.")
]
Spec = Annotated[
    Path | None, typer.Option("--spec", metavar="FILE", help="Acceptance limits; default specs/<rig>.toml.")
]
RequireVerdict = Annotated[
    bool, typer.Option("--require-verdict", help="A run that no limit judged is an ERROR, not DONE.")
]
