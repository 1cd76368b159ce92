"""What a procedure is made of: declared quantities, a plan, `acquire`, `analyse` and figures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.figures import Shown
from bench.findings import Finding
from bench.plan import BenchPlan
from bench.procedure.requires import Requires
from bench.procedure.roles import RigState
from bench.quantity import Measured, Quantity

if TYPE_CHECKING:
    from bench.calibration import Need
    from bench.procedure.rig import Rig
    from bench.recording import Recording
    from bench.recording.recorder import Recorder
    from bench.rigfile import RigFile
    from bench.uncertainty import Estimate


__all__ = ["BenchPlan", "Measured", "Procedure", "Quantity", "read_method"]


def read_method(file: str) -> str:
    """The report's method section of a procedure: `method.md` beside its `file`, plain paragraphs parted by empty lines."""
    return Path(file).with_name("method.md").read_text("utf-8")


def _no_figures(_: Recording[Any]) -> Iterable[Shown]:
    return ()


def _no_problems(_rig: RigFile, _plan: Any) -> Iterable[str]:
    return ()


def _no_settings(_: Any) -> Mapping[str, float]:
    return {}


def _unknown_count(_: Any) -> int:
    return 0


def _no_needs(_: Any) -> tuple[Need, ...]:
    return ()


def _numbers_of(plan: BenchPlan) -> Mapping[str, float]:
    numbers = {name: getattr(plan, name) for name in type(plan).model_fields}
    return {k: float(v) for k, v in numbers.items() if isinstance(v, int | float) and not isinstance(v, bool)}


@dataclass(frozen=True)
class Procedure:
    """A procedure. `acquire` moves the machine, `analyse` is pure and sees only the closed file.

    `requires` is what a rig must have, whatever the plan. `check` looks at a plan against a rig that has it, before anything
    starts, and names what cannot work. `settings` are the
    controller parameters (SI) that the runner writes in READY, before it levitates. `step_count` is how many steps
    `acquire` will record, for the progress display; 0 is unknown. `fewest_steps` is how many a run that goes to its end has
    at least, where these are fewer.
    `analyse` yields what it measured and what it found, in the order of the report. `figures` come in the order in which a
    specialist looks at them: the first two stand on page 1, and so do its tables.

    `needs` are the calibrations that a run with that plan uses; it reads them with `Recording.calibration`. `facts` is
    what `bench adopt` keeps of a run: values by name, None for what `analyse` yields. `holds_for` are the settings that these
    facts hold for, by default the plan's numbers; a setting that a need names must be equal in it.

    `reached` are patterns of influences' identities ("!" takes away again): a check of the procedure sees an error of such a
    one that matters. The others of Type B in its budgets are listed on the report as what no data can show, with the
    sentences of `assumes`: what is in no budget and no data of any size can show, each with its sensitivity.
    """

    name: str
    title: str
    measures: tuple[Quantity, ...]
    state: RigState
    plan: type[BenchPlan]
    acquire: Callable[[Rig, Any, Recorder], None]
    analyse: Callable[[Recording[Any]], Iterator[Measured | Finding]]
    figures: Callable[[Recording[Any]], Iterable[Shown]] = field(default=_no_figures)
    requires: Requires = field(default=Requires())
    check: Callable[[RigFile, Any], Iterable[str]] = field(default=_no_problems)
    settings: Callable[[Any], Mapping[str, float]] = field(default=_no_settings)
    step_count: Callable[[Any], int] = field(default=_unknown_count)
    fewest_steps: Callable[[Any], int] | None = None
    needs: Callable[[Any], tuple[Need, ...]] = field(default=_no_needs)
    facts: Callable[[Recording[Any]], Mapping[str, Estimate]] | None = None
    holds_for: Callable[[Any], Mapping[str, float]] = field(default=_numbers_of)
    optional: tuple[
        Quantity, ...
    ] = ()  # of the measures, what a sound machine may not have: not missing where no limit asks
    reached: tuple[str, ...] = ()
    assumes: tuple[str, ...] = ()
    method: str = ""  # the report's method section: plain paragraphs, blank-line separated

    def problems(self, rig: RigFile, plan: Any) -> tuple[str, ...]:
        """What cannot work, found before anything starts: what the rig lacks, else what the plan asks too much of it."""
        return self.requires.lacking(rig) or tuple(self.check(rig, plan))
