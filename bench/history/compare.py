"""The difference of two runs of one procedure: of each quantity with its uncertainty, what they share removed.

d = B - A is an estimate whose influences are those of both. One that is the same thing in both acts by the difference of its
sensitivities, c_B - c_A (GUM 5.2.2, F.1.2.3), and so drops out where these are equal; every other acts by its own. E_n = d/U_d
(ISO/IEC 17043 B.4.1.1, with U of the difference where that has the root of a sum of squares) is beyond 1 where the 95 %
interval of d leaves 0 out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from bench.errors import BenchError, ConfigError
from bench.history.cautions import cautions
from bench.history.shared import Identities, as_one, identities, linear, renamed
from bench.record.forms import certified_in, in_units
from bench.record.records import Measurement, Record
from bench.rigfile.aliases import in_full
from bench.uncertainty import Estimate, Influence, budget, interval
from bench.uncertainty.forms import by_numbers
from bench.uncertainty.maineffects import drawn_over_u

Key = str
"""Of a quantity at its place: `K@inboard`, `B`."""
Found = Mapping[tuple[str, str], Estimate]
Anew = Callable[[Path], Found]
"""Estimates of a run by name and place, found anew in its recording.

Raises:
    BenchError: it has none, or it cannot be analysed."""
Source = Literal["record", "recording", "apart"]
STRAIGHT = 0.02  # of u: what a contribution by draws may differ from that of a linear model


@dataclass(frozen=True)
class Side:
    """One of the two runs: its directory and record."""

    path: Path
    record: Record


@dataclass(frozen=True)
class Part:
    """An influence on a difference: signed contributions to A's value and to B's, and the size of that to the difference, all
    in the quantity's unit. `alone` is by how many of its standard uncertainties it would have to be off to make the difference
    by itself, None where it cannot; of one that both runs share: how much it would have to have changed between them."""

    name: str
    influence: str
    in_a: float
    in_b: float
    left: float
    alone: float | None

    @property
    def shared(self) -> bool:
        return self.in_a != 0 and self.in_b != 0


@dataclass(frozen=True)
class Difference:
    """Of one quantity, in `unit`. `value` is B - A, [low, high] its 95 % interval and U half of its width; u and dof None as in
    a record. `en` is None where no uncertainty is left. `source` says what it was made from: the budgets of the records; the
    recordings, where a value is not linear in its influences; `apart` where these cannot be had, and nothing is taken as
    shared. `removed` is the share of u_A^2 + u_B^2 that the two have in common. `least` is what U would be if every bound that
    both runs found for themselves under one name had one cause: U takes them for two."""

    name: str
    where: str
    unit: str
    a: Measurement
    b: Measurement
    value: float
    u: float | None
    U: float
    low: float
    high: float
    dof: float | None
    method: str
    en: float | None
    removed: float
    least: float
    source: Source
    parts: tuple[Part, ...]

    @property
    def beyond(self) -> bool:
        """Whether the interval of the difference leaves 0 out."""
        return self.value != 0 if self.en is None else abs(self.en) > 1

    @property
    def perhaps(self) -> bool:
        """Whether it would be, if bounds of both runs had one cause."""
        return self.beyond or abs(self.value) > self.least


@dataclass(frozen=True)
class Comparison:
    """`only` are quantities that one of the two alone has measured; `cautions` what keeps the differences from saying what they
    seem to say, a sentence each."""

    a: Side
    b: Side
    one_machine: bool
    differences: tuple[Difference, ...]
    only: tuple[str, ...]
    cautions: tuple[str, ...]


def compare(a: Side, b: Side, anew: Anew | None = None) -> Comparison:
    """Every quantity that both runs have measured, B less A.

    Args:
        anew: analyses the recordings, asked only where a value is not linear in its influences, so that its interval is of
            draws that no record holds.

    Raises:
        ConfigError: the runs cannot be compared.
    """
    _refuse(a, b)
    one, other = in_units(a.record), in_units(b.record)
    ours, theirs = _measured(one, other), _measured(other, one)
    both = [key for key in ours if key in theirs and ours[key].unit == theirs[key].unit]
    if not both:
        raise ConfigError(f"{a.path} and {b.path}: found no quantity that both have measured; expected one at least. "
                          f"Next: `bench runs --procedure {a.record.procedure}` lists others")  # fmt: skip
    of = identities(one, other)
    again = _anew(a, b, of, anew) if any(bent(ours[k]) or bent(theirs[k]) for k in both) else {}
    found = tuple(_difference(ours[k], theirs[k], a.record.run_id, b.record.run_id, of, again) for k in both)
    only = tuple(k for k in (*ours, *theirs) if k not in both)
    return Comparison(a, b, of.one_machine, found, tuple(dict.fromkeys(only)), tuple(cautions(a.record, b.record)))


def _refuse(a: Side, b: Side) -> None:
    for side in (a, b):
        if side.record.ended is None:
            raise ConfigError(
                f"{side.path}: found a run that has not ended: it is still being written, or its process was killed; expected "
                "a finished one. Next: wait for its end; of one that was killed, `bench analyse` tells what its recording holds"
            )
    one, other = a.record, b.record
    if one.run_id == other.run_id:
        raise ConfigError(
            f"{b.path}: found the same run twice ({one.run_id}); expected two runs. Next: `bench runs` lists them"
        )
    if one.procedure != other.procedure:
        raise ConfigError(
            f"{a.path} is of {one.procedure}, {b.path} of {other.procedure}: they measure different quantities; expected two "
            f"runs of one procedure. Next: `bench runs --procedure {one.procedure}` lists others"
        )


def _measured(record: Record, other: Record) -> dict[Key, Measurement]:
    """What has a value, by kind and place; of a record that does not say the rig's own names by those that the other says."""
    setup = record.setup or other.setup
    aliases = {} if setup is None else setup.aliases
    named = ((f"{m.name}@{m.where}" if m.where else m.name, m) for m in record.measurements)
    return {
        in_full(aliases, name): m for name, m in named if m.value is not None and m.expanded_uncertainty is not None
    }


def bent(m: Measurement) -> bool:
    """Whether a value is not linear in its influences, so that its budget does not tell what it shares with another."""
    if m.method != "monte-carlo" or m.standard_uncertainty is None:
        return m.method == "monte-carlo"
    slack = STRAIGHT * m.standard_uncertainty
    spreads = [abs(e.linear) * drawn_over_u(math.inf if e.dof is None else e.dof) for e in m.budget]
    apart = any(abs(e.contribution - s) > slack and abs(e.contribution - abs(e.linear)) > slack
                for e, s in zip(m.budget, spreads, strict=True))  # fmt: skip
    return apart or abs(math.hypot(*spreads) - m.standard_uncertainty) > slack


def _anew(a: Side, b: Side, of: Identities, anew: Anew | None) -> dict[str, Found]:
    """Estimates of both runs by run id, their influences by identity; nothing where one of them cannot be had."""
    if anew is None:
        return {}
    known: dict[str, Influence] = {}
    out: dict[str, Found] = {}
    for side in (a, b):
        run_id = side.record.run_id

        def rename(i: Influence, run_id: str = run_id) -> Influence:
            key = of.of(i.id, run_id)
            return known.setdefault(key, replace(i, id=key))

        try:
            found, certified = anew(side.path), certified_in(side.record)
            out[run_id] = {key: renamed(by_numbers(e, certified), rename) for key, e in found.items()}
        except BenchError:
            return {}
    return out


def _difference(
    a: Measurement, b: Measurement, run_a: str, run_b: str, of: Identities, again: Mapping[str, Found]
) -> Difference:  # fmt: skip
    known: dict[str, Influence] = {}
    source: Source = "record"
    one, other = linear(a, run_a, of, known), linear(b, run_b, of, known)
    if bent(a) or bent(b):
        found = [again.get(run, {}).get((m.name, m.where)) for run, m in ((run_a, a), (run_b, b))]
        if found[0] is not None and found[1] is not None:
            one, other, source = found[0], found[1], "recording"
        else:
            one, other, source = _apart(a, run_a), _apart(b, run_b), "apart"
    alike = other if source == "apart" or not of.one_machine else as_one(other, one, run_b, run_a)
    return _stated(a, b, one, other, source, least=interval(alike - one).U if alike != other else None)


def _apart(m: Measurement, run_id: str) -> Estimate:
    """A value with one influence of its own that is as uncertain as it."""
    assert m.value is not None
    assert m.expanded_uncertainty is not None
    u = m.standard_uncertainty if m.standard_uncertainty is not None else m.expanded_uncertainty / 2
    own = Influence(
        f"{run_id}/whole", f"all of {run_id}", u, m.unit, "B", "normal", math.inf if m.dof is None else m.dof
    )
    return Estimate.of(m.value, own)


def _stated(
    a: Measurement, b: Measurement, one: Estimate, other: Estimate, source: Source, least: float | None
) -> Difference:
    d = other - one
    found = interval(d)
    drawn = [u for u in (a.standard_uncertainty, b.standard_uncertainty, found.u) if u is not None]
    # Few degrees of freedom leave no u of draws to compare: those of the linear models say what is shared.
    u_a, u_b, u_d = (one.u, other.u, d.u) if source == "record" or len(drawn) < 3 else drawn
    whole = u_a**2 + u_b**2
    towards = d.value - found.low if d.value > 0 else found.high - d.value
    # What is left of equal numbers by rounding is no uncertainty.
    both = math.hypot(a.expanded_uncertainty or 0.0, b.expanded_uncertainty or 0.0)
    nothing = both * 1e-12 >= found.U
    en = (0.0 if d.value == 0 else None) if nothing or towards <= 0 else d.value / towards
    return Difference(
        name=a.name, where=a.where, unit=a.unit, a=a, b=b, value=d.value, u=found.u, U=found.U, low=found.low, high=found.high,
        dof=found.dof if math.isfinite(found.dof) else None, method=found.method, en=en,
        removed=1 - u_d**2 / whole if whole > 0 else 0.0, source=source,
        least=found.U if least is None else min(least, found.U), parts=tuple(_parts(one, other, d, found)),
    )  # fmt: skip


def _parts(one: Estimate, other: Estimate, d: Estimate, found: object) -> Iterator[Part]:
    """Largest contribution to the difference first; then what the two have in common, the largest first."""
    in_a, in_b = one.contributions, other.contributions
    rows = budget(d, found)  # type: ignore[arg-type]
    rows.sort(key=lambda r: (-r.contribution, -max(abs(in_a.get(r.id, 0.0)), abs(in_b.get(r.id, 0.0)))))
    for row in rows:
        a, b = in_a.get(row.id, 0.0), in_b.get(row.id, 0.0)
        acts = max(abs(a), abs(b)) if a and b else row.contribution
        yield Part(row.name, row.id, a, b, row.contribution, abs(d.value) / acts if acts > 0 else None)
