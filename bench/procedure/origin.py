"""Where a procedure is from that is none of ours, as a recording and a record say it."""

from __future__ import annotations

from dataclasses import dataclass

ATTACHED = "procedure.py"  # in the recording: the text of a procedure in one file
FILE = "sha256:"  # a version that begins so is a file's


@dataclass(frozen=True, slots=True)
class Origin:
    """`name` and `version` stand among a record's versions: a distribution with its version, or a file's name with the digest
    of its text. Of a file `text` is what was executed, and `path` where it lay."""

    name: str
    version: str
    text: str = ""
    path: str = ""

    @property
    def of_file(self) -> bool:
        """Whether it is a file that was named on the command line."""
        return self.version.startswith(FILE)

    def __str__(self) -> str:
        return f"{self.name} {self.version}"

    @classmethod
    def parse(cls, said: str) -> Origin | None:
        """What a recording says of it; None of a procedure of ours."""
        name, _, version = said.rpartition(" ")
        return cls(name, version) if name else None
