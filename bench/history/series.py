"""Which results make one history: of one quantity of one machine by one procedure, in one unit, in the order of their times."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Literal

from bench.errors import ConfigError

if TYPE_CHECKING:
    from bench.run.indexrow import Result

LISTED = 6  # of what there is, in a message
BROKEN = ("ERROR", "ABORTED")  # outcomes of which values are not taken


@dataclass(frozen=True)
class History:
    """Values of one quantity, oldest first. `times` are days since 1970 UTC, or the visits of a virtual machine, of which each
    is another day. `broken` runs ended in an error and are left out, `repeated` ones are the same simulation or the same run
    once more, `twins` are of a simulation of the machine, served or not."""

    results: tuple[Result, ...]
    times: tuple[float, ...]
    axis: Literal["date", "visit"]
    broken: int
    repeated: int
    twins: int = 0


def one_history(
    found: Sequence[Result], quantity: str, known: Callable[[], Sequence[str]], place: str, twins: int = 0
) -> History:
    """The history that `found`, the results of the index for `quantity`, are.

    Args:
        known: the names that the index has, for the message where nothing was found.
        place: where was looked, in words.
        twins: how many runs of simulations were left out, as there are some of a real machine.

    Raises:
        ConfigError: there is no such quantity, or it is several, or in several units, or of one run.
    """
    if not found:
        raise ConfigError(_nothing(quantity, known(), place))
    _require_one("quantity", (r.name for r in found), f"trend of {quantity}", "Next: `bench trend {!r}`")
    whole = [r for r in found if r.value is not None and r.outcome not in BROKEN]
    told = whole or found  # a run that gave no value is no other history
    units = {(r.procedure, r.unit) for r in told}
    if len({unit for _, unit in units}) > 1:
        listed = "; ".join(f"{unit} by {procedure}" for procedure, unit in sorted(units))
        raise ConfigError(
            f"trend of {quantity}: found different units: {listed}; expected one. Next: add --procedure NAME"
        )
    _require_one("procedure", (r.procedure for r in told), f"trend of {quantity}", "Next: add --procedure {}")
    _require_one("machine", map(machine, told), f"trend of {quantity}", f"Next: {_apart(told)}")
    once = _each_once(whole)
    if len(once) < 2:
        raise ConfigError(f"trend of {quantity}: found {_counted(len(once), 'run')} with a value in {place}; expected 2 or "
                          f"more. Next: run the procedure again, or {_seen(twins)}")  # fmt: skip
    by_visit = once[0].seed is not None and len({r.visit for r in once}) == len(once)
    timed = sorted((float(r.visit or 0) if by_visit else days(r.started), k) for k, r in enumerate(once))
    return History(tuple(once[k] for _, k in timed), tuple(t for t, _ in timed), "visit" if by_visit else "date",
                   _same(found, once[0]) - len(whole), len(whole) - len(once), twins)  # fmt: skip


def machine(r: Result) -> str:
    """Which machine a result is of, in words."""
    which = f"seed {r.seed}" if r.seed is not None else "served simulation" if r.served else r.uut
    return f"{r.rig} ({which})" if which else r.rig


def _same(found: Iterable[Result], one: Result) -> int:
    """How many results are of the procedure and machine of one."""
    return sum((r.procedure, machine(r)) == (one.procedure, machine(one)) for r in found)


def _apart(found: Sequence[Result]) -> str:
    """How one of several machines is chosen."""
    if len({r.machine for r in found}) > 1:
        return f"add --machine {' or '.join(sorted({r.machine for r in found}))}"
    if len({r.rig for r in found}) > 1:
        return "add --rig NAME"
    if len({r.seed for r in found}) > 1:
        return "add --seed N"
    return "keep the runs of each in a folder of its own, and name it with --out"


def _seen(twins: int) -> str:
    """What else may be followed, where a real machine has too few runs."""
    if not twins:
        return "`bench runs` to see what is there"
    return f"follow its twin, which has {_counted(twins, 'run')}, by --machine served or simulated"


def days(started: str) -> float:
    """A date and time of ISO 8601 as days since 1970, UTC."""
    moment = datetime.fromisoformat(started)
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp() / 86400


def _each_once(results: Iterable[Result]) -> list[Result]:
    """Without runs that measured nothing new: the same simulation once more, a seed and visit with equal plan and value; a copy
    of a run's directory, which began at the same second and has the same value. Copies would halve the moving range."""
    out: dict[Hashable, Result] = {}
    for r in results:
        key = (r.started if r.seed is None else r.seed, r.visit, r.settings, r.value)
        out.setdefault(key, r)
    return list(out.values())


def _require_one(what: str, values: Iterable[str], where: str, then: str) -> None:
    times = Counter(values)
    if len(times) > 1:
        listed = "; ".join(f"{name} ({_counted(n, 'run')})" for name, n in times.most_common(LISTED))
        more = f" and {len(times) - LISTED} more" if len(times) > LISTED else ""
        message = f"{where}: found several of {what}: {listed}{more}; expected one"
        raise ConfigError(f"{message}. {then.format(times.most_common(1)[0][0])}")


def _nothing(quantity: str, known: Sequence[str], place: str) -> str:
    if not known:
        return (
            f"trend of {quantity}: found no results in {place}; expected a folder of runs. Next: name it with --out DIR"
        )
    if quantity in known:
        options = "--rig, --procedure, --machine or --seed"
        return f"trend of {quantity}: found no such result in {place} by {options}; expected some. Next: leave them out"
    folded = {name.casefold(): name for name in reversed(known)}
    near = [folded[n] for n in difflib.get_close_matches(quantity.casefold(), folded, LISTED, cutoff=0.5)]
    told = f"the nearest names are {', '.join(near)}" if near else f"there are {', '.join(known[:LISTED])}"
    first = near[0] if near else known[0]
    return f"trend of {quantity}: found no such quantity in {place}; {told}. Next: `bench trend {first!r}`"


def _counted(n: int, what: str) -> str:
    return f"{n} {what}" + ("" if n == 1 else "s")
