"""The command `bench`: what can be typed. `bench.cli.dispatch` reads it, `bench.cli.status` says what exit status it ends with.

Only the declarations live here; each command imports its module when it is used, so that `--help` and `list` are fast.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from bench.cli import options as o
from bench.cli import stored, threads
from bench.cli.dispatch import run_app

app = typer.Typer(
    help="Test and calibrate magnetically levitated machines, real or simulated.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _version(asked: bool) -> None:
    if asked:
        from bench import __version__

        sys.stdout.write(f"bench {__version__}\n")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Test and calibrate magnetically levitated machines, real or simulated."""


@app.command("list")
def list_(
    rig: Annotated[
        str, typer.Option("--rig", metavar="RIG", help="Which procedures this rig can run, and what the others lack.")
    ] = "",
) -> int:
    """Show procedures, rigs and campaigns. With --rig what that one can run."""
    from bench.cli.check import show_abilities, show_list

    return show_abilities(rig) if rig else show_list()


@app.command()
def completion(
    shell: Annotated[str, typer.Argument(metavar="SHELL", help="bash, zsh or fish; default: yours.")] = "",
) -> int:
    """Write a script that completes commands, options and names.

    Bash: eval "$(bench completion bash)" in ~/.bashrc.
    """
    from bench.cli.completion import completion_command

    return completion_command(shell, app)


@app.command()
def schema(
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help="rig, spec, campaign or plan-PROCEDURE; default: all, into a folder.")
    ] = "",
    into: Annotated[Path | None, typer.Option("--into", metavar="FOLDER", help="Default for all: schemas.")] = None,
) -> int:
    """Write JSON schemas of our files, for editors. Rig files, specs, campaigns and plans.

    One goes to standard output, all go into a folder.
    """
    from bench.cli.schemas import schema_command

    return schema_command(kind, into)


@app.command()
def check(
    rig: o.RigArgument,
    procedure: Annotated[str, typer.Argument(metavar="PROCEDURE", help="Say all that it lacks for this one.")] = "",
) -> int:
    """Validate a rig file and say what it can run. Names every error at once."""
    from bench.cli.check import check_rig_file

    return check_rig_file(rig, procedure)


@app.command()
def run(
    procedure: Annotated[
        str, typer.Argument(metavar="PROCEDURE", help="A name that `bench list` shows, or a file that holds one.")
    ] = "",
    rig: o.RigOption = "",
    backend: Annotated[o.Backend | None, typer.Option(help="The simulated rig (default), or the real one.")] = None,
    seed: o.Seed = None,
    visit: o.Visit = None,
    plan: o.Plans = None,
    plan_file: o.PlanFile = None,
    truth: o.Truth = None,
    link: o.Links = None,
    fault: o.Faults = None,
    clear_fault: o.ClearFault = False,
    out: o.Out = Path("runs"),
    operator: o.Operator = None,
    no_report: o.NoReport = False,
    calibrations: o.Calibrations = None,
    model: o.Model = None,
    allow_expired: o.AllowExpired = False,
    spec: o.Spec = None,
    require_verdict: o.RequireVerdict = False,
    go_on: o.GoOn = None,
    live: o.Live = False,
    live_port: o.LivePort = None,
    live_bind: o.LiveBind = None,
    verbose: o.Verbose = False,
) -> int:
    """Run a procedure on a rig. Or, with --continue, go on with a run that was stopped.

    The last line on standard output is the run directory.
    """
    from bench.cli.compose import Request
    from bench.cli.live import asked_page
    from bench.cli.meant import meant
    from bench.cli.run import run_command

    named = backend.value if backend else "" if go_on else "sim"
    asked = Request(
        procedure=procedure, rig=rig, backend=named, seed=seed, visit=visit, links=tuple(link or ()),
        plan=tuple(plan or ()), plan_file=plan_file, truth=tuple(truth or ()), faults=tuple(fault or ()),
        clear_fault=clear_fault, out=out, operator=operator.value if operator else None, report=not no_report,
        calibrations=calibrations, model=model, allow_expired=allow_expired, spec=spec, require_verdict=require_verdict,
        continues=meant(go_on) if go_on else None,
    )  # fmt: skip
    return run_command(asked, verbose, asked_page(live, live_port, live_bind))


@app.command()
def campaign(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A campaign file, or its name in campaigns/.")],
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes for many rigs; default: one per core.")] = None,
    out: Annotated[Path, typer.Option("--out", help="Folder of the campaign directories.")] = Path("runs"),
    rig: Annotated[str | None, typer.Option("--rig", metavar="RIG", help="Another rig than the file's.")] = None,
    backend: Annotated[o.Backend | None, typer.Option(help="The simulated rig, or the real one.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, max=o.LARGEST, help="One virtual rig: which.")] = None,
    visit: Annotated[
        int | None, typer.Option(min=0, max=o.LARGEST, help="Another day of the same virtual rigs; default the file's.")
    ] = None,
    count: Annotated[int | None, typer.Option(min=1, help="Many virtual rigs: how many.")] = None,
    first_seed: Annotated[
        int | None, typer.Option("--first-seed", min=0, max=o.LARGEST, help="Many: the first seed.")
    ] = None,
    link: o.Links = None,
    operator: Annotated[o.OperatorKind | None, typer.Option(help="One rig: as for `run`.")] = None,
    no_report: Annotated[bool, typer.Option("--no-report", help="Leave reports and summary out.")] = False,
    keep: Annotated[o.Keep | None, typer.Option(help="Many: whose recordings stay; default missed.")] = None,
    go_on: Annotated[
        bool, typer.Option("--go-on", help="One rig: go on after a step that is neither PASS nor DONE.")
    ] = False,
    new: Annotated[bool, typer.Option("--new", help="Start anew, whatever is unfinished.")] = False,
    short: Annotated[bool, typer.Option("--short", help="One virtual rig: with the short plans of many.")] = False,
    scheduler: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Many: on the workers of a Dask scheduler, as tcp://HOST:8786.")
    ] = "",
) -> int:
    """Run a list of procedures on a rig. Also on many virtual ones; goes on where it was stopped.

    The last line on standard output is the campaign's directory.
    """
    from bench.cli.campaign.asked import CampaignRequest
    from bench.cli.campaign.command import campaign_command

    asked = CampaignRequest(
        campaign=file, jobs=jobs, out=out, rig=rig, backend=backend.value if backend else None, seed=seed, visit=visit,
        count=count, first_seed=first_seed, links=tuple(link or ()), operator=operator.value if operator else None,
        report=not no_report, keep=keep.value if keep else None, go_on=go_on, new=new, short=short, scheduler=scheduler,
    )  # fmt: skip
    return campaign_command(asked)


for of_stored_runs in (
    stored.adopt,
    stored.calibrations,
    stored.analyse,
    stored.report,
    stored.runs,
    stored.show,
    stored.compare,
    stored.trend,
    stored.export,
):
    app.command()(of_stored_runs)


@app.command()
def listen(
    rig: o.RigArgument,
    link: o.Links = None,
    seconds: Annotated[float | None, typer.Option(min=0.1, help="End by itself; default: on Ctrl-C.")] = None,
    record: Annotated[bool, typer.Option("--record", help="Keep what came, in a run directory.")] = False,
    out: o.Out = Path("runs"),
    poll: Annotated[
        bool, typer.Option("--poll", help="Read the register devices too: a request each time; nothing is written.")
    ] = False,
    acknowledge: Annotated[
        bool, typer.Option("--acknowledge", help="CAN: acknowledge frames, where no other node does; none is sent.")
    ] = False,
) -> int:
    """Listen to a rig's controller and show what it says. Sends nothing, not even a heartbeat.

    With --record the last line on standard output is the run directory.
    """
    from bench.cli.listen.command import ListenRequest, listen_command

    return listen_command(
        ListenRequest(
            rig=rig,
            links=tuple(link or ()),
            seconds=seconds,
            record=record,
            out=out,
            poll=poll,
            acknowledge=acknowledge,
        )
    )


@app.command()
def serve(
    rig: o.RigArgument,
    seed: Annotated[int, typer.Option(min=0, max=o.LARGEST, help="Which virtual rig.")] = 0,
    visit: Annotated[int, typer.Option(min=0, max=o.LARGEST, help="Another day of the same virtual rig.")] = 0,
    truth: o.Truth = None,
    bind: Annotated[str, typer.Option(metavar="ADDR", help="Address of every TCP port.")] = "127.0.0.1",
    truth_file: Annotated[Path | None, typer.Option("--truth-file", help="Write what was drawn to this file.")] = None,
    link: Annotated[
        list[str] | None, typer.Option("--link", metavar="NAME=URL", help="Listen somewhere else; repeatable.")
    ] = None,
    fault: o.Faults = None,
    live: o.Live = False,
    live_port: o.LivePort = None,
    live_bind: o.LiveBind = None,
) -> int:
    """Serve the simulated rig in real time. For `run --backend live` and for programs of your own.

    Prints an endpoint a line, then `ready`; ends on Ctrl-C.
    """
    from bench.cli.live import asked_page
    from bench.cli.serve import ServeRequest, serve_command

    return serve_command(
        ServeRequest(
            rig=rig,
            seed=seed,
            visit=visit,
            truth=tuple(truth or ()),
            bind=bind,
            truth_file=truth_file,
            links=tuple(link or ()),
            faults=tuple(fault or ()),
            page=asked_page(live, live_port, live_bind),
        )
    )


@app.command("map")
def map_(
    table: Annotated[str, typer.Argument(metavar="TABLE", help="A CSV file, or the name of an installed table.")],
    poles: Annotated[int, typer.Option(min=2, help="Poles of the motor.")] = 16,
    against: Annotated[
        str, typer.Option("--against", metavar="MODEL", help="Also say how well a model's constants predict the table.")
    ] = "",
    out: Annotated[Path | None, typer.Option("--out", help="Folder of the results; default maps/TABLE.")] = None,
) -> int:
    """Identify a motor's force map from operating points. They stand in a table; no rig is needed."""
    from bench.cli.force_map import Request, map_command

    return map_command(Request(table=table, poles=poles, against=against, out=out))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit status. Nothing that goes wrong leaves as a traceback."""
    threads.limit()
    return run_app(app, sys.argv[1:] if arguments is None else list(arguments))


if __name__ == "__main__":
    sys.exit(main())
