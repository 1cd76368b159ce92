"""What a procedure is made of: declared quantities, a plan, `acquire`, `analyse` and figures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.errors import ConfigError, Lacking, Unfit
from bench.figures import Shown
from bench.findings import Ended, Finding, Findings
from bench.plan import BenchPlan
from bench.procedure.names import by_names_of, quantities_on
from bench.procedure.origin import Origin
from bench.procedure.requires import Requires, lacking
from bench.procedure.roles import RigState
from bench.quantity import Measured, Quantity
from bench.rigfile.aliases import known_as

if TYPE_CHECKING:
    from bench.calibration import Calibration, Need
    from bench.procedure.rig import Rig
    from bench.recording import Recording
    from bench.recording.recorder import Recorder
    from bench.rigfile import RigFile
    from bench.uncertainty import Estimate


__all__ = ["BenchPlan", "Measured", "Procedure", "Quantity", "read_method"]


def read_method(file: str) -> str:
    """The report's method section of a procedure: `method.md` beside its `file`, plain paragraphs parted by empty lines.

    Raises:
        ConfigError: there is none.
    """
    path = Path(file).with_name("method.md")
    if not path.is_file():
        raise ConfigError(f"{path}: found none; expected the report's method section. Next: write it there, or give "
                          'Procedure its text: method="..."')  # fmt: skip
    return path.read_text("utf-8")


def _as_recorded(recording: Recording[Any], _: Findings) -> Recording[Any]:
    return recording


def _no_figures(_: Any, _recording: Recording[Any]) -> Iterable[Shown]:
    return ()


def _no_problems(_rig: RigFile, _plan: Any) -> Iterable[str]:
    return ()


def _levitation(_: RigFile) -> Requires:
    return Requires()


def _as_by_default(_: RigFile) -> Mapping[str, Any]:
    return {}


def _no_settings(_rig: RigFile, _plan: Any) -> Mapping[str, float]:
    return {}


def _all_told(_: Any) -> tuple[Quantity, ...]:
    return ()


def _unknown_count(_: Any) -> int:
    return 0


def _each(_rig: RigFile, _plan: Any) -> int:
    return 1


def _no_needs(_: Any) -> tuple[Need, ...]:
    return ()


def _nothing_foreseen(_rig: RigFile, _plan: Any, _facts: Mapping[str, Calibration]) -> Iterable[str]:
    return ()


def _numbers_of(plan: BenchPlan) -> Mapping[str, float]:
    numbers = {name: getattr(plan, name) for name in type(plan).model_fields}
    return {k: float(v) for k, v in numbers.items() if isinstance(v, int | float) and not isinstance(v, bool)}


@dataclass(frozen=True)
class Evaluated:
    """What a procedure made of a recording: findings, its result, and whether it `ended` before that was whole."""

    findings: tuple[Finding, ...]
    result: Any
    ended: bool


@dataclass(frozen=True)
class Procedure:
    """A procedure. `acquire` moves the machine, `evaluate` is pure and sees only the closed file.

    `requires` is what a rig must have, whatever the plan, by the names that its own file has. `check` looks at a plan against
    a rig that has it, before anything starts, and names what cannot work. `settings` are the parameters of the rig's
    controller, SI, that the runner writes in READY, before it levitates. `bring_up` brings the rig from READY into `state`
    where there is something to look at on the way; where it says False nothing is acquired, and the analysis tells why.
    `optional` of the measures are those that a sound machine may lack: not missing where no limit asks; `untold` are those
    that a rig cannot show, whatever its state.
    `left_out` are those that a plan does not measure: none of them is missing, and a limit for one judges nothing.
    `planned` are settings of a plan as they are on a rig by default, where those of the plan itself do not fit every rig: its
    masses, its speeds; the rig file and who asks say otherwise.
    `step_count` is how many steps `acquire` will record, for the progress display; 0 is unknown. `fewest_steps` is how many
    a run that goes to its end has at least, where these are fewer; `former_steps` how many one of plan schema 1 has, where
    it had fewer; `steps_on` is `step_count` where that depends on the rig.
    `evaluate` makes of a recording what all that follows needs, once, and tells its findings as it goes; it ends where one
    that is told at a gate is an error, and then nothing is measured nor drawn. Without it the recording itself is what
    follows needs. `measured` yields the quantities of it in the order of the report. `figures` come in the order in which
    a specialist looks at them: the first two stand on page 1, and so do its tables.

    `needs` are the calibrations that a run with that plan uses; it reads them with `Recording.calibration`. `foresees` looks at
    a plan once these are at hand, by procedure, and names what cannot work by them: still nothing was started. `facts` is
    what `bench adopt` keeps of a run: values by name, None for what `measured` yields. `holds_for` are the settings that these
    facts hold for, by default the plan's numbers; a setting that a need names must be equal in it.

    `reached` are patterns of influences' identities ("!" takes away again): a check of the procedure sees an error of such a
    one that matters. The others of Type B in its budgets are listed on the report as what no data can show, with the
    sentences of `assumes`: what is in no budget and no data of any size can show, each with its sensitivity.

    `measures` are kinds of quantities, each at the places where it is measured; `on` a rig that has names of its own for them
    they go by these, and `kinds` are what they were.

    `continues` is the kind of its steps at which a run that was stopped can go on; "" where what the machine does between them
    matters, so that it cannot (`bench.run.stopped`). `whole` are how many of these steps are worth something together alone:
    readings at a place that is set up once for all of them.

    `places` are words that stand in the `where` of what it measures, beside names of the rig and of the plan.
    """

    name: str
    title: str
    measures: tuple[Quantity, ...]
    state: RigState
    plan: type[BenchPlan]
    acquire: Callable[[Rig, Any, Recorder], None]
    measured: Callable[[Any], Iterator[Measured | Finding]]
    evaluate: Callable[[Recording[Any], Findings], Any] = field(default=_as_recorded)
    figures: Callable[[Any, Recording[Any]], Iterable[Shown]] = field(default=_no_figures)
    requires: Callable[[RigFile], Requires] = field(default=_levitation)
    check: Callable[[RigFile, Any], Iterable[str]] = field(default=_no_problems)
    planned: Callable[[RigFile], Mapping[str, Any]] = field(default=_as_by_default)
    settings: Callable[[RigFile, Any], Mapping[str, float]] = field(default=_no_settings)
    bring_up: Callable[[Rig, Recorder], bool] | None = None
    step_count: Callable[[Any], int] = field(default=_unknown_count)
    fewest_steps: Callable[[Any], int] | None = None
    steps_on: Callable[[RigFile, Any], int] | None = None
    former_steps: Callable[[Any], int] | None = None
    needs: Callable[[Any], tuple[Need, ...]] = field(default=_no_needs)
    foresees: Callable[[RigFile, Any, Mapping[str, Calibration]], Iterable[str]] = field(default=_nothing_foreseen)
    facts: Callable[[Any], Mapping[str, Estimate]] | None = None
    holds_for: Callable[[Any], Mapping[str, float]] = field(default=_numbers_of)
    optional: tuple[Quantity, ...] = ()
    untold: Callable[[RigFile], tuple[Quantity, ...]] = field(default=_all_told)
    left_out: Callable[[Any], tuple[Quantity, ...]] = field(default=_all_told)
    reached: tuple[str, ...] = ()
    assumes: tuple[str, ...] = ()
    continues: str = ""
    whole: Callable[[RigFile, Any], int] = field(default=_each)
    places: tuple[str, ...] = ()
    kinds: tuple[Quantity, ...] = ()
    method: str = ""  # the report's section: plain paragraphs, parted by empty lines
    origin: Origin | None = None  # of one that is none of ours: whoever loads it says so

    def refuse_by(self, rig: RigFile, plan: Any, calibrations: Iterable[Calibration]) -> None:
        """Raises Unfit if the plan cannot work by what is known of the rig; `calibrations` are those that it needs."""
        if problems := tuple(self.foresees(rig, plan, {c.procedure: c for c in calibrations})):
            raise Unfit(problems)

    def defaults(self, rig: RigFile) -> tuple[str, Mapping[str, Any]]:
        """The settings of a plan that a rig brings along, for `plans.assemble`: where they stand, and what they are."""
        return f"{rig.path} [plans.{self.name}]", {**self.planned(rig), **rig.plans.get(self.name, {})}

    def steps(self, rig: RigFile, plan: Any) -> int:
        """How many steps `acquire` will record on a rig; 0 is unknown."""
        return self.step_count(plan) if self.steps_on is None else self.steps_on(rig, plan)

    def on(self, rig: RigFile, plan: Any = None) -> Procedure:
        """With its quantities by the names that a rig has for them at its places; `optional` are those that a plan leaves out
        too, where there is one."""
        untold: tuple[Quantity, ...] = ()
        with suppress(Lacking):  # a rig that it cannot run on: `lacking` says so
            untold = self.untold(rig)
        may_lack = tuple(dict.fromkeys((*self.optional, *untold, *(() if plan is None else self.left_out(plan)))))
        measures, optional = (quantities_on(rig.aliases, some) for some in (self.measures, may_lack))
        if (measures, optional) == (self.measures, self.optional):
            return self
        return replace(self, measures=measures, optional=optional, kinds=self.kinds or self.measures)

    def problems(self, rig: RigFile, plan: Any) -> tuple[str, ...]:
        """What cannot work, found before anything starts: what the rig lacks, else what the plan asks too much of it."""
        return self.lacking(rig) or tuple(self.check(rig, plan))

    def lacking(self, rig: RigFile) -> tuple[str, ...]:
        """What the rig does not have, one line a table of its file; nothing where it can run the procedure."""
        return lacking(self.requires, rig)

    def evaluated(self, recording: Recording[Any]) -> Evaluated:
        """What `evaluate` makes of a recording and what it finds in it, made the first time it is asked for."""
        return recording.once(self._evaluated)

    def _evaluated(self, recording: Recording[Any]) -> Evaluated:
        findings, result, ended = Findings(), None, False
        try:
            result = self.evaluate(recording, findings)
        except Ended as end:
            result, ended = end.so_far, True
        return Evaluated(tuple(findings.told), result, ended)

    def analyse(self, recording: Recording[Any]) -> Iterator[Measured | Finding]:
        """What a closed recording says, by the names of its rig: findings first, then what was measured."""
        found = self.evaluated(recording)
        aliases = recording.rig.aliases
        yield from (by_names_of(aliases, f) for f in found.findings)
        if not found.ended:
            yield from (by_names_of(aliases, item) for item in self.measured(found.result))

    def drawn(self, recording: Recording[Any]) -> Iterable[Shown]:
        """The figures of a recording; none where its evaluation ended early and left nothing to draw."""
        found = self.evaluated(recording)
        return () if found.ended and found.result is None else self.figures(found.result, recording)

    def stated(self, recording: Recording[Any]) -> Mapping[str, Estimate]:
        """What a recording states as facts: `facts`, or what was measured, by quantity (`name@where`); nothing where its
        evaluation ended early."""
        found = self.evaluated(recording)
        if found.ended:
            return {}
        facts = self.facts(found.result) if self.facts is not None else named(
            m for m in self.measured(found.result) if isinstance(m, Measured))  # fmt: skip
        return {known_as(recording.rig.aliases, name): estimate for name, estimate in facts.items()}


def named(measured: Iterable[Measured]) -> Mapping[str, Estimate]:
    """Estimates by quantity, and by `name@where` where there are several places."""
    return {m.quantity.name + (f"@{m.where}" if m.where else ""): m.estimate for m in measured}
