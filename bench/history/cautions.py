"""What keeps a difference of two runs from saying what it seems to say: of each, and of both together."""

from __future__ import annotations

from collections.abc import Iterator

from bench.findings import CERTIFICATE_OVERDUE, Effect
from bench.record.outcomes import Outcome
from bench.record.records import Record

DOUBTFUL = (Outcome.ABORTED, Outcome.ERROR, Outcome.INDETERMINATE)
OUT_OF_DATE = (CERTIFICATE_OVERDUE, "certificate-ahead")


def cautions(a: Record, b: Record) -> Iterator[str]:
    """A sentence each: one simulation or recording twice, plans that may measure different things, records that do not say with
    what, units that differ, runs that could not be judged, certificates and calibrations that did not hold on their day."""
    yield from _together(a, b)
    for letter, record in (("A", a), ("B", b)):
        yield from _of_one(letter, record)


def _together(a: Record, b: Record) -> Iterator[str]:
    if a.seed is not None and (a.seed, a.visit, a.rig) == (b.seed, b.visit, b.rig):
        yield (f"both simulate visit {a.visit} of seed {a.seed}: B has the same errors as A once more, and equal values say "
               "nothing of how they repeat")  # fmt: skip
    if any(a.plan.get(key) != b.plan.get(key) for key in (*a.plan, *b.plan)):
        yield ("the plans differ: where a setting says what is measured (over how many angles, at which bias) one name stands "
               "for two quantities, and E_n has that in it")  # fmt: skip
    if _recordings(a) & _recordings(b):
        yield "both rest on steps of one recording, which one of them goes on with: U takes their scatter for two"
    if silent := [letter for letter, record in (("A", a), ("B", b)) if record.setup is None]:
        yield (f"{' and '.join(silent)}: a record of before schema 3, which says no parameters, firmware and certificates; "
               "what of these differs is not known, and what the rig file has is taken as it was")  # fmt: skip
    units = {(m.name, m.where): m.unit for m in a.measurements}
    for m in b.measurements:
        if (unit := units.get((m.name, m.where), m.unit)) != m.unit:
            yield f"{m.name}: found {m.unit} in B; A has {unit}: not compared"


def _recordings(record: Record) -> set[str]:
    """The runs whose steps a result was made of."""
    return {record.run_id, *(c.run_id for c in record.continues)}


def _of_one(letter: str, record: Record) -> Iterator[str]:
    if record.outcome in DOUBTFUL:
        codes = dict.fromkeys(f.code for f in record.findings if f.effect is not Effect.NOTE)
        why = f" ({', '.join(codes)})" if codes else ""
        yield f"{letter} ended {record.outcome.value}{why}: its values may be off by more than their U"
    if late := list(dict.fromkeys(f.where.rpartition(".")[2] for f in record.findings if f.code in OUT_OF_DATE)):
        yield f"{letter} rests on certificates that did not hold on its day: {', '.join(late)}"
    if expired := [c.procedure for c in record.calibrations if c.state == "expired"]:
        yield f"{letter} rests on calibrations that had expired: {', '.join(expired)}"
