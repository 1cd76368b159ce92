"""`pytest procedures --rig RIG`: the procedures as tests of a machine. A composition root.

One item per procedure, collected only when `--rig` is given. PASS and DONE pass the item, FAIL and INDETERMINATE fail it,
ERROR and ABORTED are errors (the run happens in the item's set-up, so that pytest counts them as such); a procedure that the
rig cannot run at all is skipped. Measured quantities become JUnit properties of the item, provenance those of the suite.
`bench.cli.suite` sees to the calibrations.

The fixture `inject` runs a procedure while faults happen to the link or the controller.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from bench import __version__, catalogue
from bench.errors import BenchError, ConfigError

if TYPE_CHECKING:
    from bench.cli.suite import Suite
    from bench.run.runner import RunResult

ROOT = Path(__file__).resolve().parent
SUITE: pytest.StashKey[Suite] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("levbench", "procedures on a rig: pytest procedures --rig RIG")
    group.addoption("--rig", metavar="RIG", help="a rig file, or its name in rigs/")
    group.addoption("--backend", choices=("sim", "live"), default="sim", help="the simulated rig, or the real one")
    group.addoption("--seed", type=int, help="which virtual rig (simulation only)")
    group.addoption("--visit", type=int, help="another day of the same virtual rig (simulation only)")
    group.addoption("--plan", action="append", default=[], metavar="[PROCEDURE:]KEY=VALUE",
                    help="a setting, of one procedure or of each that has it; repeatable")  # fmt: skip
    group.addoption("--fault", action="append", default=[], metavar="FAULT", help="a fault to inject; repeatable")
    group.addoption("--no-report", action="store_true", help="leave the reports out")
    group.addoption(
        "--calibrations", type=Path, metavar="DIR", help="folder of calibrations; default beside the rig file"
    )
    group.addoption("--adopt", action="store_true", help="what ends PASS or DONE becomes the rig's calibration")
    group.addoption("--spec", type=Path, metavar="FILE", help="acceptance limits; default specs/<rig>.toml")
    group.addoption("--require-verdict", action="store_true", help="a run that no limit judged is an error")
    group.addoption("--out", type=Path, default=Path("runs"), help="folder of the run directories")


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> ProcedureFile | None:
    """The modules that the catalogue names, once there is a rig to run them on."""
    if parent.config.getoption("--rig") is None or file_path not in _modules():
        return None
    return ProcedureFile.from_parent(parent, path=file_path)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Procedures in the order of the catalogue, which is that of the chain: later ones need the earlier ones' results."""
    order = {entry.name: number for number, entry in enumerate(catalogue.PROCEDURES)}
    places = [n for n, item in enumerate(items) if isinstance(item, ProcedureItem)]
    for place, item in zip(places, sorted((items[n] for n in places), key=lambda i: order[i.name]), strict=True):
        items[place] = item


def pytest_sessionstart(session: pytest.Session) -> None:
    """The machine under test; provenance into the JUnit file, if one is written.

    Raises:
        UsageError: the rig file or a setting of the command line.
    """
    config = session.config
    if config.getoption("--rig") is None:
        return
    from _pytest.junitxml import xml_key  # pytest offers suite properties to fixtures only

    folder = tempfile.TemporaryDirectory(prefix="levbench-")
    config.add_cleanup(folder.cleanup)
    try:
        suite = config.stash[SUITE] = _suite(config, Path(folder.name))
    except ConfigError as error:
        raise pytest.UsageError(str(error)) from error
    if (xml := config.stash.get(xml_key, None)) is not None:
        for name in ("rig", "backend"):
            xml.add_global_property(f"levbench.{name}", str(config.getoption(f"--{name}")))
        if suite.seed is not None:
            xml.add_global_property("levbench.seed", str(suite.seed))
            xml.add_global_property("levbench.visit", str(suite.visit))
        xml.add_global_property("levbench.version", __version__)
        xml.add_global_property("python", sys.version.split()[0])


def _suite(config: pytest.Config, folder: Path) -> Suite:
    from bench.cli.compose import Request
    from bench.cli.suite import Suite

    option = config.getoption
    asked = Request(
        procedure="",
        rig=option("--rig"),
        backend=option("--backend"),
        seed=option("--seed"),
        visit=option("--visit"),
        faults=tuple(option("--fault")),
        out=option("--out"),
        report=not option("--no-report"),
        calibrations=option("--calibrations"),
        spec=option("--spec"),
        require_verdict=option("--require-verdict"),
    )
    return Suite(asked, folder, tuple(option("--plan")), option("--adopt"))


@pytest.fixture
def inject(tmp_path: Path) -> Callable[..., RunResult]:
    """Runs a procedure on the simulated rig while faults happen: `inject("stall@12", procedure="amb-calibration")`.

    Further keywords are those of `bench.cli.compose.Request`: `rig`, `seed`, `visit`, `plan`, `truth`, `backend`, `links`.
    The run directory lies in `tmp_path`; what comes back is a `bench.run.runner.RunResult`.
    """
    from bench.cli.compose import Request
    from bench.cli.run import execute

    def run(*faults: str, procedure: str, rig: str = "tsbs12", **options: Any) -> RunResult:
        return execute(Request(procedure, rig, faults=faults, out=tmp_path / "runs", report=False, **options))

    return run


def _modules() -> dict[Path, catalogue.Entry]:
    return {ROOT.joinpath(*e.module.split(".")).with_suffix(".py"): e for e in catalogue.PROCEDURES}


class ProcedureFile(pytest.File):
    """A module of `procedures/` that the catalogue names."""

    def collect(self) -> Iterator[pytest.Item]:
        entry = _modules()[self.path]
        yield ProcedureItem.from_parent(self, name=entry.name)


class ProcedureItem(pytest.Item):
    """One procedure on the rig of the command line."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.result: RunResult | None = None
        self.add_marker(pytest.mark.timeout(0))  # a calibration takes as long as it takes

    def setup(self) -> None:
        from bench.cli.suite import properties

        suite = self.config.stash[SUITE]
        try:
            if lacking := suite.lacking(self.name):
                pytest.skip(f"{self.config.getoption('--rig')} cannot run it: {'; '.join(lacking)}")
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
        return self.path, 0, f"{self.name} on {self.config.getoption('--rig')}"


def _told(result: RunResult) -> str:
    """As the command line sums a run up: outcome, what decided, values with their places and limits, where to look."""
    from bench.cli.summary import summary

    return f"{summary(result.record, result.directory)}{result.directory}"
