"""Who works on the linear-rotary actuator: answers questions, and has nothing to hang on it."""

from __future__ import annotations


class Attendant:
    """Says yes."""

    def request(self, line: str) -> str:
        """One line: `ask TEXT`. Answers `yes` or `error TEXT`."""
        return "yes" if line.split()[:1] == ["ask"] else f"error cannot {line.strip()!r}"
