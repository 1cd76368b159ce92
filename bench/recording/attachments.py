"""What a recording carries beside its samples: rig file, plan, spec, calibrations, and what it says of its run."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from bench.calibration import Calibration
from bench.calibration.file import attached
from bench.errors import AnalysisError, ConfigError, RecordingError
from bench.plan import BenchPlan
from bench.recording import stored, storedplan
from bench.recording.mcapfile import McapFile
from bench.rigfile import MOST_DBC, MOST_TOML, RigFile
from bench.rigfile.aliases import with_full_names

P = TypeVar("P", bound=BenchPlan)
Q = TypeVar("Q", bound=BenchPlan)
J = TypeVar("J", dict[str, Any], list[Any])
MOST_JSON = 8 << 20  # bytes of an attachment that is no DBC


class Attachments(Generic[P]):
    """The attachments and the metadata of one recording, whose plan is of a type, None where nobody asks for it. `settings` of
    it are other ones than it was made with, for an analysis that tries them."""

    def __init__(
        self, file: McapFile, plan: type[P] | None, settings: Mapping[str, Any] = MappingProxyType({})
    ) -> None:
        self._file, self._plan_class, self._settings = file, plan, settings
        self.path: Path = file.path

    @cached_property
    def rig(self) -> RigFile:
        """The rig file as it was when the run was made.

        Raises:
            RecordingError: it cannot be used.
        """
        try:
            return RigFile.parse(
                self.attachment("rig.toml"), self.attachment("rig.dbc"), "rig.toml (from the recording)"
            )
        except ConfigError as error:
            raise RecordingError(f"recording {self.path}: {error}") from error

    @cached_property
    def plan(self) -> P:
        """The plan the run was made with."""
        if self._plan_class is None:
            raise AnalysisError("the recording was opened without a plan type")
        return self.plan_as(self._plan_class)

    def plan_as(self, kind: type[Q]) -> Q:
        """The plan as a type of one's choice.

        Raises:
            RecordingError: the stored plan is not of that type.
        """
        try:
            return kind.model_validate_json(json.dumps(self.plan_dict))
        except ValueError as error:
            raise RecordingError(f"{self.path}: its plan is no {kind.__name__}: {error}") from error

    @property
    def plan_dict(self) -> dict[str, Any]:
        """The settings, as today's schema has them.

        Raises:
            RecordingError: the plan is not there, cannot be read, or is of a newer schema.
        """
        try:
            return storedplan.migrated(self._json("plan.json", dict), self.run.get("procedure", "")) | dict(
                self._settings
            )
        except ConfigError as error:
            raise RecordingError(f"recording {self.path}: {error}") from error

    @property
    def plan_schema(self) -> int:
        """The schema of its plan.json; 1 where it says none."""
        return storedplan.schema_of(self._json("plan.json", dict))

    @property
    def spec(self) -> dict[str, Any]:
        """The acceptance limits that the run was made with, by quantity."""
        return self._json("spec.json", dict)

    @cached_property
    def calibrations(self) -> tuple[Calibration, ...]:
        """The calibrations that the run used, whole, as they were then; values by the rig's own names, and by kind and place.

        Raises:
            RecordingError: they cannot be understood.
        """
        try:
            found = attached(self.attachment("calibrations.json"), f"recording {self.path}")
            return tuple(replace(c, values=with_full_names(self.rig.aliases, c.values)) for c in found)
        except ConfigError as error:
            raise RecordingError(str(error)) from error

    def calibration(self, procedure: str) -> Calibration:
        """The calibration by a procedure that the run used.

        Raises:
            AnalysisError: it used none; the procedure that runs must name it in its `needs`.
        """
        for found in self.calibrations:
            if found.procedure == procedure:
                return found
        used = ", ".join(c.procedure for c in self.calibrations) or "none"
        raise AnalysisError(f"{self.path.name}: found calibrations by {used}; expected one by {procedure}")

    def _json(self, name: str, kind: type[J]) -> J:
        found = stored.parsed(self.attachment(name), f"recording {self.path}: attachment {name!r}")
        if not isinstance(found, kind):
            raise RecordingError(
                f"recording {self.path}: attachment {name!r}: found a {type(found).__name__}; expected a {kind.__name__}"
            )
        return found

    @property
    def versions(self) -> dict[str, str]:
        return self._file.metadata.get("versions", {})

    @property
    def wall(self) -> dict[str, str]:
        """What came from the wall clock: dates, host, durations."""
        return self._file.metadata.get("wall", {})

    @property
    def run(self) -> dict[str, str]:
        """Procedure, backend, seed and visit as strings."""
        return self._file.metadata.get("run", {})

    @property
    def verdict_required(self) -> bool:
        """Whether the run was to give a verdict: one without is an error."""
        return self.run.get("verdict") == "required"

    @property
    def procedure(self) -> str:
        return self.run.get("procedure", "")

    @property
    def seed(self) -> int | None:
        """Which virtual rig; None for a real one."""
        return self._whole("seed")

    @property
    def visit(self) -> int | None:
        """On which day, 0 where nothing is said; None for a real rig."""
        return None if self.seed is None else self._whole("visit") or 0

    def _whole(self, name: str) -> int | None:
        text = self.run.get(name, "")
        try:
            return int(text) if text else None
        except ValueError as error:
            raise RecordingError(f"recording {self.path}: {name}: found {text[:40]!r}; expected an integer") from error

    def attachment(self, name: str) -> str:
        """An attached text.

        Raises:
            RecordingError: the recording has none of that name, or a larger one than any of ours.
        """
        try:
            data = self._file.attachments[name]
            if len(data) > (MOST_DBC if name == "rig.dbc" else MOST_TOML if name == "rig.toml" else MOST_JSON):
                raise RecordingError(
                    f"recording {self.path}: attachment {name!r} has {len(data)} bytes; expected fewer"
                )
            return data.decode("utf-8")
        except (KeyError, UnicodeDecodeError) as error:
            raise RecordingError(f"recording {self.path}: attachment {name!r} is missing or not text") from error

    def digest(self) -> str:
        """SHA-256 of the file."""
        with self.path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
