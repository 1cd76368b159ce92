"""`pytest procedures --rig RIG`: the procedures as tests of a machine. A composition root.

One item per procedure, collected only when `--rig` is given. FAIL and INDETERMINATE fail the item, ERROR and ABORTED
are errors (the run happens in the item's set-up, so that pytest counts them as such). Measured quantities become
JUnit properties of the item, provenance becomes properties of the suite.

The fixture `inject` runs a procedure while faults happen to the link or the controller.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from bench import __version__, catalogue
from bench.errors import BenchError

if TYPE_CHECKING:
    from bench.runner import RunResult

ROOT = Path(__file__).resolve().parent


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("levbench", "procedures on a rig: pytest procedures --rig RIG")
    group.addoption("--rig", metavar="RIG", help="a rig file, or its name in rigs/")
    group.addoption("--backend", choices=("sim", "live"), default="sim", help="the simulated rig, or the real one")
    group.addoption("--seed", type=int, help="which virtual rig (simulation only)")
    group.addoption("--plan", action="append", default=[], metavar="KEY=VALUE", help="a setting; repeatable")
    group.addoption("--fault", action="append", default=[], metavar="FAULT", help="a fault to inject; repeatable")
    group.addoption("--no-report", action="store_true", help="leave the reports out")
    group.addoption(
        "--calibrations", type=Path, metavar="DIR", help="folder of calibrations; default beside the rig file"
    )
    group.addoption(
        "--adopt", action="store_true", help="what passes becomes a calibration for the procedures after it"
    )
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
    """Provenance into the JUnit file, if one is written."""
    config = session.config
    if config.getoption("--rig") is None:
        return
    from _pytest.junitxml import xml_key  # pytest offers suite properties to fixtures only

    if (xml := config.stash.get(xml_key, None)) is not None:
        for name in ("rig", "backend", "seed"):
            xml.add_global_property(f"levbench.{name}", str(config.getoption(f"--{name}")))
        xml.add_global_property("levbench.version", __version__)
        xml.add_global_property("python", sys.version.split()[0])


@pytest.fixture
def inject(tmp_path: Path) -> Callable[..., RunResult]:
    """Runs a procedure on the simulated rig while faults happen: `inject("stall@12", procedure="amb-calibration")`.

    Further keywords are those of `bench.cli.compose.Request`: `rig`, `seed`, `plan`, `truth`, `backend`, `links`. The run
    directory lies in `tmp_path`; what comes back is a `bench.runner.RunResult`.
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
        from bench.cli.compose import Request
        from bench.cli.run import execute
        from bench.outcomes import Outcome

        option = self.config.getoption
        request = Request(
            procedure=self.name,
            rig=option("--rig"),
            backend=option("--backend"),
            seed=option("--seed"),
            plan=tuple(option("--plan")),
            faults=tuple(option("--fault")),
            out=option("--out"),
            report=not option("--no-report"),
            calibrations=option("--calibrations"),
        )
        with warnings.catch_warnings():
            warnings.simplefilter("default")  # the machine is on trial here, not the software
            self.result = execute(request)
        self._note(self.result)
        if self.result.stopped_by_signal:
            self.session.shouldstop = self.result.reason
        if self.result.outcome in (Outcome.ERROR, Outcome.ABORTED):
            raise NotMeasured(self.result)
        if option("--adopt") and self.result.outcome is Outcome.PASS:
            from bench.cli.adopt import adopt

            adopt(self.result.directory, option("--rig"), option("--calibrations"))

    def runtest(self) -> None:
        from bench.outcomes import Outcome

        assert self.result is not None
        if self.result.outcome is not Outcome.PASS:
            raise NotPassed(self.result)

    def _note(self, result: RunResult) -> None:
        self.user_properties.append(("run", str(result.directory)))
        self.user_properties.append(("outcome", str(result.outcome)))
        for m in result.record.measurements:
            for field in ("value", "expanded_uncertainty", "unit", "verdict"):
                self.user_properties.append((f"{m.name}.{field}", str(getattr(m, field))))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """A sentence instead of a traceback, for what Levbench raises on purpose."""
        if isinstance(excinfo.value, BenchError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int, str]:
        return self.path, 0, f"{self.name} on {self.config.getoption('--rig')}"


class NotPassed(BenchError):
    """FAIL or INDETERMINATE."""

    def __init__(self, result: RunResult) -> None:
        super().__init__(f"{result.outcome}: {result.reason}\n{result.directory}")


class NotMeasured(NotPassed):
    """ERROR or ABORTED."""
