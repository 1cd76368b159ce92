"""What the commands of `bench` take: choices, and options that several of them share."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


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
    BLF = "blf"
    ASC = "asc"
    CANDUMP = "candump"


class Keep(StrEnum):
    """Which recordings of a campaign over many rigs stay."""

    ALL = "all"
    MISSED = "missed"
    NONE = "none"


Out = Annotated[Path, typer.Option("--out", help="Folder of the run directories.")]
Calibrations = Annotated[
    Path | None,
    typer.Option("--calibrations", metavar="DIR", help="Folder of calibrations; default beside the rig file."),
]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="Say every result and every note, not only what was judged.")
]
RunArgument = Annotated[Path, typer.Argument(metavar="RUN", help="A run directory.")]
