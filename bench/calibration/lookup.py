"""Before a run: the calibrations that it needs, looked up and refused if they do not fit, each with what helps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime

from bench.calibration.calibration import Calibration, Need, changed_certificates, settings_differ
from bench.calibration.store import Store, named
from bench.errors import ConfigError
from bench.rigfile import RigFile


@dataclass(frozen=True)
class Lookup:
    """Where to look, and by which clock. `remedy` gives the command lines that make the calibration that is needed; `given`,
    by procedure, go before what lies in the store."""

    store: Store
    rig: RigFile
    now: datetime
    remedy: Callable[[Need], str]
    allow_expired: bool = False
    given: Mapping[str, Calibration] = field(default_factory=dict)

    def found(self, procedure: str, needs: Sequence[Need]) -> tuple[Calibration, ...]:
        """The current calibrations that a procedure needs, in the order of its needs.

        Raises:
            ConfigError: one is missing, expired (unless that is allowed), dated in the future, of another machine, made at
                other settings or with other certificates; every problem is in it, with the commands that help.
        """
        found: list[Calibration] = []
        problems: list[str] = []
        for need in needs:
            calibration = self._problems(need, problems)
            if calibration is not None:
                found.append(calibration.used_at(self.now))
        if problems:
            title = f"{procedure} on {self.rig.name} needs calibrations that are missing or do not fit; nothing was started:"
            raise ConfigError("\n  ".join([title, *problems]))
        return tuple(found)

    def _problems(self, need: Need, problems: list[str]) -> Calibration | None:
        """The calibration; what is wrong with it is added to `problems`."""
        try:
            calibration = self.given.get(need.procedure) or self.store.current(need.procedure)
        except ConfigError as error:
            problems.append(f"{error}\n    next: {self.remedy(need)}")
            return None
        if calibration is None:
            if need.optional:
                return None
            problems.append(
                f"{need.procedure}: found none for {named(self.store.seed)} in {self.store.folder}\n"
                f"    next: {self.remedy(need)}"
            )
            return None
        problems += [
            f"{need.procedure} ({calibration.run_id}): {said}\n    next: {self.remedy(need)}"
            for said in self._refusals(need, calibration)
        ]
        return calibration

    def _refusals(self, need: Need, c: Calibration) -> Iterator[str]:
        if c.procedure != need.procedure:
            yield f"is a calibration by {c.procedure}"
        elif foreign := self.store.foreign(c):
            yield f"is {foreign}"
        elif differ := settings_differ(c.settings, need.settings):
            yield "made at other settings: " + "; ".join(differ)
        elif lacks := [name for name in need.facts if name not in c.values]:
            yield f"does not hold {', '.join(lacks)}; it has {', '.join(sorted(c.values)) or 'no values'}"
        elif changed := changed_certificates(c.certificates, self.rig):
            yield "made with other certificates than the rig file has now:\n      " + "\n      ".join(changed)
        elif c.ahead(self.now):
            yield f"dated {c.date}, which is in the future; see that this computer's clock is right"
        elif c.overdue(self.now) and not self.allow_expired:
            yield f"expired on {c.due}; --allow-expired uses it all the same, and the report says so"
