"""`pytest --rig RIG`: procedures as tests of a machine. A composition root, and a plug-in where Levbench is installed.

It lies dormant until a session is given `--rig`: it has no option before that, and none of its hooks does anything, so that the
sessions of other projects are as they would be without it. An option whose name another plug-in or a conftest has by then stays
theirs and is `--levbench-NAME` here; if that is `--rig` itself, nobody asks for a machine.

One item per procedure: of the whole catalogue where no path is given, else of the paths' modules, or of a file that holds one.
PASS and DONE pass the item, FAIL and INDETERMINATE fail it, ERROR and ABORTED are errors (the run happens in the item's set-up,
so that pytest counts them as such); a procedure that the rig cannot run at all is skipped. Measured quantities become JUnit
properties of the item, provenance those of the suite. `bench.cli.suite` sees to the calibrations.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from bench.cli.suite import Suite
    from bench.run.runner import RunResult


def _number(text: str) -> int:
    """A seed or visit."""
    from bench.rundir import LARGEST

    if not (text.isascii() and text.isdecimal() and int(text) <= LARGEST):
        raise argparse.ArgumentTypeError(f"found {text!r}; expected a whole number from 0 to {LARGEST}")
    return int(text)


NAME = "levbench"  # of the plug-in, and the prefix of options whose own name is taken
SUITE: pytest.StashKey[Suite] = pytest.StashKey()
TAKEN: pytest.StashKey[tuple[str, ...]] = pytest.StashKey()
OPTIONS: dict[str, dict[str, Any]] = {
    "rig": {"metavar": "RIG", "help": "a rig file, or its name in rigs/"},
    "backend": {"choices": ("sim", "live"), "default": "sim", "help": "the simulated rig, or the real one"},
    "seed": {"type": _number, "metavar": "N", "help": "which virtual rig (simulation only)"},
    "visit": {"type": _number, "metavar": "N", "help": "another day of the same virtual rig (simulation only)"},
    "plan": {"action": "append", "default": [], "metavar": "[PROCEDURE:]KEY=VALUE",
             "help": "a setting, of one procedure or of each that has it; repeatable"},
    "fault": {"action": "append", "default": [], "metavar": "FAULT", "help": "a fault to inject; repeatable"},
    "no-report": {"action": "store_true", "help": "leave the reports out"},
    "calibrations": {"type": Path, "metavar": "DIR", "help": "folder of calibrations; default beside the rig file"},
    "adopt": {"action": "store_true", "help": "what ends PASS or DONE becomes the rig's calibration"},
    "spec": {"type": Path, "metavar": "FILE", "help": "acceptance limits; default specs/<rig>.toml"},
    "require-verdict": {"action": "store_true", "help": "a run that no limit judged is an error"},
    "out": {"type": Path, "default": Path("runs"), "help": "folder of the run directories"},
}  # fmt: skip


@pytest.hookimpl(wrapper=True)
def pytest_load_initial_conftests(
    early_config: pytest.Config, parser: pytest.Parser, args: list[str]
) -> Generator[None, None, None]:
    """Options once all others have theirs, and only where a rig is asked for, or what can be asked for."""
    yield
    if any(a.partition("=")[0] in ("--rig", f"--{NAME}-rig", "--help", "-h") for a in args):
        add_options(early_config, parser)


def add_options(config: pytest.Config, parser: pytest.Parser) -> None:
    """Register the options, once; one whose name is taken goes by a longer one."""
    if TAKEN in config.stash:
        return
    group = parser.getgroup(NAME, "procedures on a rig: pytest --rig RIG")
    taken = []
    for name, settings in OPTIONS.items():
        words = {"dest": _dest(name), **settings}
        try:
            group.addoption(f"--{name}", **words)
        except (ValueError, argparse.ArgumentError):
            taken.append(name)
            group.addoption(f"--{NAME}-{name}", **words)
    config.stash[TAKEN] = tuple(taken)


def _dest(name: str) -> str:
    return f"{NAME}_{name.replace('-', '_')}"


def option(config: pytest.Config, name: str) -> Any:
    """What an option was given, or its default; None where no rig was asked for."""
    return config.getoption(_dest(name), None)


def pytest_report_header(config: pytest.Config) -> list[str]:
    """Which options are somebody else's."""
    taken = config.stash.get(TAKEN, ())
    if option(config, "rig") is None or not taken:
        return []
    return [f"{NAME}: another plug-in has {', '.join(f'--{n}' for n in taken)}; here: --{NAME}-NAME"]


def pytest_sessionstart(session: pytest.Session) -> None:
    """The machine under test; provenance into the JUnit file, if one is written.

    Raises:
        UsageError: the rig file or a setting of the command line.
    """
    config = session.config
    if option(config, "rig") is None:
        return
    from bench.errors import ConfigError

    folder = tempfile.TemporaryDirectory(prefix="levbench-")
    config.add_cleanup(folder.cleanup)
    try:
        suite = config.stash[SUITE] = _suite(config, Path(folder.name))
    except ConfigError as error:
        raise pytest.UsageError(str(error)) from error
    if config.args_source is not pytest.Config.ArgsSource.ARGS:
        config.args = []  # no path: the catalogue, not the tests of whatever lies here
    _tell_junit(config, suite)


def _tell_junit(config: pytest.Config, suite: Suite) -> None:
    from _pytest.junitxml import xml_key  # pytest offers suite properties to fixtures only

    from bench import __version__

    if (xml := config.stash.get(xml_key, None)) is not None:
        for name in ("rig", "backend"):
            xml.add_global_property(f"levbench.{name}", str(option(config, name)))
        if suite.seed is not None:
            xml.add_global_property("levbench.seed", str(suite.seed))
            xml.add_global_property("levbench.visit", str(suite.visit))
        xml.add_global_property("levbench.version", __version__)
        xml.add_global_property("python", sys.version.split()[0])


def _suite(config: pytest.Config, folder: Path) -> Suite:
    from bench.cli.compose import Request
    from bench.cli.suite import Suite

    asked = Request(
        procedure="",
        rig=option(config, "rig"),
        backend=option(config, "backend"),
        seed=option(config, "seed"),
        visit=option(config, "visit"),
        faults=tuple(option(config, "fault")),
        out=option(config, "out"),
        report=not option(config, "no-report"),
        calibrations=option(config, "calibrations"),
        spec=option(config, "spec"),
        require_verdict=option(config, "require-verdict"),
    )
    return Suite(asked, folder, tuple(option(config, "plan")), option(config, "adopt"))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """The catalogue, beside nothing else, where a rig is given and no path."""
    report = yield
    config = collector.config
    if isinstance(collector, pytest.Session) and SUITE in config.stash and not config.args and report.passed:
        report.result.append(Catalogue.from_parent(collector, name=NAME, nodeid=NAME))
    return report


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> ProcedureFile | None:
    """The modules that the catalogue names, and files that are given and hold a procedure, once there is a rig for them."""
    return ProcedureFile.from_parent(parent, path=file_path) if _is_procedure(file_path, parent) else None


@pytest.hookimpl(tryfirst=True)
def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector) -> pytest.Module | None:
    """What is collected as a procedure is no module of tests: it is not imported once more."""
    return NoTests.from_parent(parent, path=module_path) if _is_procedure(module_path, parent) else None


def _is_procedure(path: Path, parent: pytest.Collector) -> bool:
    if path.suffix != ".py" or SUITE not in parent.config.stash:
        return False
    from bench import catalogue
    from bench.cli.loading import holds_procedure

    if any(catalogue.file_of(e) == path for e in catalogue.PROCEDURES):
        return True
    return holds_procedure(path) and (parent.session.isinitpath(path) or catalogue.of_file(path) is not None)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Procedures in the order of the catalogue, which is that of the chain: later ones need the earlier ones' results."""
    places = [n for n, item in enumerate(items) if isinstance(item, ProcedureItem)]
    if not places:
        return
    from bench import catalogue

    order = {entry.name: number for number, entry in enumerate(catalogue.procedures())}
    chosen = sorted((items[n] for n in places), key=lambda i: order.get(i.name, len(order)))
    for place, item in zip(places, chosen, strict=True):
        items[place] = item


class Catalogue(pytest.Collector):
    """Every procedure that there is; one whose name is taken twice is an item that says so."""

    def collect(self) -> Sequence[pytest.Item]:
        from bench import catalogue

        names = dict.fromkeys([*(e.name for e in catalogue.procedures()), *(n for n, _ in catalogue.taken_twice())])
        return [ProcedureItem.from_parent(self, name=name) for name in names]


class ProcedureFile(pytest.File):
    """A module that the catalogue names, or a file that holds a procedure."""

    def collect(self) -> Iterator[pytest.Item]:
        from bench import catalogue
        from bench.cli.loading import load_file
        from bench.errors import ConfigError

        ours = next((e.name for e in catalogue.PROCEDURES if catalogue.file_of(e) == self.path), "")
        try:
            yield ProcedureItem.from_parent(self, name=ours or load_file(self.path).name)
        except ConfigError as error:
            raise self.CollectError(str(error)) from error


class NoTests(pytest.Module):
    """A procedure's file in the place of a module of tests."""

    def collect(self) -> Sequence[pytest.Item]:
        return []


class ProcedureItem(pytest.Item):
    """One procedure on the rig of the command line."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.result: RunResult | None = None
        if self.config.pluginmanager.has_plugin("timeout"):
            self.add_marker(pytest.mark.timeout(0))  # a calibration takes as long as it takes

    def setup(self) -> None:
        from bench.cli.suite import properties
        from bench.errors import BenchError

        suite = self.config.stash[SUITE]
        try:
            if lacking := suite.lacking(self.name):
                pytest.skip(f"{option(self.config, 'rig')} cannot run it: {'; '.join(lacking)}")
            with warnings.catch_warnings():
                warnings.simplefilter("default")  # the machine is on trial here, not the software
                self.result = suite.run(self.name)
        except BenchError as error:
            pytest.fail(str(error), pytrace=False)  # in the set-up: an error
        self.user_properties += properties(self.result)
        self.user_properties += [(f"needs.{name}", str(run)) for name, run in suite.made_for(self.name).items()]
        if self.result.stopped_by_signal:
            self.session.shouldstop = self.result.reason
        if self.result.outcome.value in ("ERROR", "ABORTED"):
            pytest.fail(_told(self.result), pytrace=False)

    def runtest(self) -> None:
        assert self.result is not None
        if not self.result.outcome.sound:
            pytest.fail(_told(self.result), pytrace=False)

    def reportinfo(self) -> tuple[Path, int, str]:
        return self.path, 0, f"{self.name} on {option(self.config, 'rig')}"


def _told(result: RunResult) -> str:
    """As the command line sums a run up: outcome, what decided, values with their places and limits, where to look."""
    from bench.cli.summary import summary

    return f"{summary(result.record, result.directory)}{result.directory}"
