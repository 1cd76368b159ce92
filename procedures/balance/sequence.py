"""How a balancing goes on: runs with and without weights, decisions in between, weights fixed on the landed shaft."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from bench.errors import AnalysisError
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.recording.recorder import Recorder
from bench.rigfile.roles import STATUS
from procedures.amb_rotor import lift
from procedures.amb_rotor.conventions import conventions
from procedures.balance import decision
from procedures.balance.plan import Plan
from procedures.balance.planes import chosen, names_of
from procedures.balance.steps import (
    BASE,
    DECISION,
    LIGHTER,
    MOUNT,
    REFUSED,
    TAKEN_OFF,
    UNMOUNT,
    Read,
    Run,
    Weight,
    captured_channels,
    known_by,
    read_capture,
    read_telemetry,
    watched_channels,
)
from procedures.shared.rates import rate_of
from procedures.synchronous import bearings, dwelling
from procedures.synchronous.dwells import DWELL, SLOW, can_capture

SLOW_HZ = 500.0  # of the slow roll's capture
MARGIN_S = 0.1  # of a dwell beside its capture


@dataclass
class Work:
    """A balancing under way: what is on the shaft, what was read so far."""

    rig: Rig
    plan: Plan
    record: Recorder
    mounted: list[Weight] = field(default_factory=list)
    runs: list[Run] = field(default_factory=list)
    slow: Read | None = None
    fixed: int = 0
    found: tuple[int, bearings.Known] | None = None  # after so many runs
    dwells: int = 0

    @property
    def known(self) -> bearings.Known:
        """What is known of the bearings."""
        known = bearings.Known.of(self.record.calibrations, self.plan.beta_share, self.plan.offset_u_m)
        if self.found is None or self.found[0] != len(self.runs):
            self.found = (len(self.runs), known_by(self.slow, self.runs, self.rig.file, known))
        return self.found[1]


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Look, lift and nudge; slow roll and base run; a run with a trial weight in each plane; corrections, each verified."""
    rig = replace(rig, file=chosen(rig.file, plan.planes))
    work = Work(rig, plan, record)
    if not lift.lift_and_nudge(rig, record):
        return
    dwelling.select(rig, plan.law)
    if not _roll(work) or not _run(work, BASE):
        return
    for p, side in enumerate(names_of(rig.file)):
        kg, allowed = _allowed(work, p)
        if kg < plan.trial_kg[p]:
            record.event(LIGHTER if kg else REFUSED, plane=side, kg=plan.trial_kg[p], allowed_kg=kg or allowed)
        if not kg:
            return
        _mount(work, p, kg, plan.trial_angle_rad[p], "trial")
        if not _run(work, f"trial {side}") or not _has_acted(work, p):
            return
        if not plan.leave:
            _unmount(work, p)
    _correct(work)


def _allowed(work: Work, plane: int) -> tuple[float, float]:
    """As `decision.trial_kg`. A trial weight that was to stay on is taken off where with it the next one may not turn."""
    rig, plan, base = work.rig.file, work.plan, work.runs[0]
    kg, allowed = decision.trial_kg(rig, plan, work.runs[-1] if work.mounted else base, plane)
    if kg or not work.mounted:
        return kg, allowed
    alone = decision.trial_kg(rig, plan, base, plane)
    if alone[0]:
        sides = names_of(rig)
        work.record.event(TAKEN_OFF, plane=sides[plane], taken=sides[1 - plane])
        _unmount(work, 1 - plane)
    return alone


def _roll(work: Work) -> bool:
    """The slow roll, where the plan has one."""
    rig, plan = work.rig, work.plan
    if not plan.slow_rad_s:
        return True
    if not lift.bring_to_speed(rig, work.record, plan.slow_rad_s, plan.settle_s):
        dwelling.stop(rig)
        return False
    work.slow = _dwell(work, SLOW, BASE, plan.slow_rad_s, plan.slow_s, plan.slow_s, rate_of(rig.file, None, SLOW_HZ))
    if work.slow is None:
        dwelling.stop(rig)
    return work.slow is not None


def _run(work: Work, name: str) -> bool:
    """Levitated, all speeds, the lowest again, stopped and landed; False where it was not completed or not sound."""
    rig, plan = work.rig, work.plan
    if rig.levitation.state is RigState.READY:  # the base run goes on from the slow roll
        transition(rig, RigState.LEVITATED)
    dwelling.select(rig, plan.law)
    reads: list[Read] = []
    speeds = sorted(plan.speeds_rad_s)
    for speed in (*speeds, *(speeds[:1] if plan.repeat else ())):
        if not lift.bring_to_speed(rig, work.record, speed, plan.settle_s):
            break
        read = _dwell(work, DWELL, name, speed, plan.dwell_s, plan.capture_s, None, again=len(reads) == len(speeds))
        if read is None or not read.sound or abs(read.speed / speed - 1) > plan.max_speed_error:
            break  # the analysis says why
        reads.append(read)
    dwelling.stop(rig)
    transition(rig, RigState.READY)
    if len(reads) < len(speeds) + plan.repeat:
        return False
    run = Run(name, tuple(work.mounted), tuple(reads[: len(speeds)]), reads[-1] if plan.repeat else None)
    work.runs.append(run)
    return not list(decision.find_slips(run))


def _dwell(
    work: Work, kind: str, name: str, speed: float, seconds: float, capture_s: float, rate_hz: float | None,
    again: bool = False,
) -> Read | None:  # fmt: skip
    """A recorded dwell and what its capture says, None where that cannot be told."""
    rig, number, machine = work.rig, -1 if again else work.dwells, conventions(work.rig.file)
    driven = rig.drive.speed_rad_s if rig.drive is not None else 0.0
    labels = {"speed_rad_s": speed, "variant": name, "driven_rad_s": driven, "number": number, "again": again}
    work.dwells += 1
    if rig.capture is None or not can_capture(rig.file):
        return _watch(work, kind, labels, seconds)
    with work.record.step(kind, **labels):
        rig.capture.arm(captured_channels(machine), seconds=capture_s, rate_hz=rate_hz)
        rig.capture.wait(capture_s + 5.0)
        rig.clock.sleep(max(seconds - capture_s, MARGIN_S))
    touched = int(rig.levitation.reading(STATUS)) & machine.contact
    data = rig.capture.upload(run=name, speed_rad_s=speed)
    try:
        return None if touched else read_capture(data, machine, kind == SLOW)
    except AnalysisError:
        return None  # of the pulses; the analysis says what is wrong with them


def _watch(work: Work, kind: str, labels: Mapping[str, object], seconds: float) -> Read | None:
    """The same by the telemetry as it comes, where the controller captures nothing."""
    rig = work.rig
    with work.record.step(kind, **labels), work.record.watching(watched_channels(rig.file)) as seen:
        rig.clock.sleep(seconds)
    if int(rig.levitation.reading(STATUS)) & conventions(rig.file).contact:
        return None
    try:
        return read_telemetry(rig.file, seen, kind == SLOW)
    except (AnalysisError, KeyError):
        return None


def _mount(work: Work, plane: int, kg: float, angle: float, purpose: str) -> None:
    """Have a weight fixed; the shaft is landed."""
    side = names_of(work.rig.file)[plane]
    with work.record.step(MOUNT, plane=side, kg=kg, angle_rad=angle, purpose=purpose):
        really = work.rig.operator.attach(side, kg, angle)
        if really != (kg, angle):
            kg, angle = really
            work.record.correct(kg=kg, angle_rad=angle)
    work.fixed += 1
    work.mounted.append(Weight(plane, kg, angle, work.fixed))


def _unmount(work: Work, plane: int) -> None:
    """Have every weight of a plane taken off."""
    side = names_of(work.rig.file)[plane]
    with work.record.step(UNMOUNT, plane=side):
        work.rig.operator.detach(side)
    work.mounted = [w for w in work.mounted if w.plane != plane]


def _has_acted(work: Work, plane: int) -> bool:
    """Whether the trial weight of the last run did what it should."""
    base, last = work.runs[0], work.runs[-1]
    before = decision.before_trial(base, work.runs[-2], last)
    shown = decision.observe(before, last, last.weights[-1], work.rig.file, work.known)
    return not list(decision.of_trial(shown))


def _correct(work: Work) -> None:
    """Corrections, each with its verification run, until it is reached or the plan allows no more."""
    from procedures.balance import estimates

    rig, plan = work.rig.file, work.plan
    trials = decision.trials_of(work.runs, rig)
    assert trials is not None
    by_plane = zip(trials.before, trials.having, trials.weights, strict=True)
    inboard, outboard = (decision.observe(*of, rig, work.known) for of in by_plane)
    if list(decision.of_trials(inboard, outboard)):
        return
    present = work.runs[-1] if plan.leave else trials.base
    for n in range(plan.corrections):
        found = estimates.solve_runs(work.slow, [present], trials, rig, plan, work.known)
        needed = decision.correction(found, present.name, rig, plan)
        work.record.event(DECISION, run=present.name, reached=needed.reached, too_heavy_kg=needed.too_heavy)
        if needed.reached or needed.too_heavy or not needed.weights:  # what is missing is not a matter of weights
            return
        for plane, kg, angle in needed.weights:
            _mount(work, plane, kg, angle, f"correction {n + 1}")
        if not _run(work, f"check {n + 1}"):
            return
        present = work.runs[-1]
