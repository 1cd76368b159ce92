"""Faults on purpose: their grammar, and what they do to a stream of frames.

    KIND[=VALUE][@START[+DURATION]]

START is in seconds after the first frame that the host sends (default 0), DURATION in seconds (default: to the end).
`drop=0.01@20+5` loses one percent of the controller's frames for five seconds.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from bench.errors import ConfigError
from bench.findings import Finding

SHARES: Final = ("drop", "duplicate", "reorder", "corrupt")
"""VALUE is a share of the controller's frames, above 0 and at most 1."""
TIMES: Final = ("delay", "burst")
"""VALUE is a time in seconds."""
CUTS: Final = ("disconnect", "bus-off")
"""Nothing passes and what is sent meanwhile is lost; the host's end of the link says so."""
DEVICE_ONLY: Final = ("reboot", "stuck-heartbeat")
"""They happen inside the controller: only a simulated one can be asked for them."""
KINDS: Final = (*SHARES, *TIMES, "stall", *CUTS, "mute", *DEVICE_ONLY)
REBOOT_S: Final = 0.2  # how long a controller that restarts is silent, unless the fault says
FOREVER: Final = 1 << 62
SAID: Final = {
    "disconnect": "unplugged, or its other end closed",
    "bus-off": "the interface is bus-off; look for a short, a missing terminator or a wrong bit rate",
}

Mask = npt.NDArray[np.bool_]
_NUMBER = r"\d+(?:\.\d*)?(?:[eE]-?\d+)?|\.\d+"
_GRAMMAR = re.compile(
    rf"(?P<kind>[a-z-]+)(?:=(?P<value>{_NUMBER}))?(?:@(?P<start>{_NUMBER})(?:\+(?P<length>{_NUMBER}))?)?"
)


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: `value` is a share or seconds (0 for kinds without), times in seconds after the first host frame."""

    kind: str
    value: float = 0.0
    start_s: float = 0.0
    duration_s: float | None = None

    def window(self, origin_ns: int) -> tuple[int, int]:
        """First ns and the ns after the last, counted from the first host frame at `origin_ns`."""
        begin = origin_ns + round(self.start_s * 1e9)
        return begin, FOREVER if self.duration_s is None else begin + round(self.duration_s * 1e9)

    def __str__(self) -> str:
        value = f"={self.value:g}" if self.value else ""
        length = "" if self.duration_s is None else f"+{self.duration_s:g}"
        return f"{self.kind}{value}@{self.start_s:g}{length}"


def parse(text: str) -> Fault:
    """A fault from its text.

    Raises:
        ConfigError: an unknown kind, or a value that is missing, not wanted or out of its range.
    """
    found = _GRAMMAR.fullmatch(text.strip())
    kind = found["kind"] if found else re.split("[=@]", text.strip(), maxsplit=1)[0]
    if kind not in KINDS:
        close = difflib.get_close_matches(kind, KINDS, 1)
        hint = f"did you mean {close[0]!r}?" if close else f"expected one of {', '.join(KINDS)}"
        raise ConfigError(f"--fault {text}: found kind {kind!r}; {hint}")
    if found is None:
        raise ConfigError(f"--fault {text}: expected KIND[=VALUE][@START[+DURATION]], such as {_example(kind)}")
    value, length = float(found["value"] or 0), found["length"]
    if kind in (*SHARES, *TIMES):
        limit, what = (1.0, "a share above 0 and at most 1") if kind in SHARES else (3600.0, "seconds above 0")
        if not 0 < value <= limit:
            raise ConfigError(
                f"--fault {text}: found {found['value'] or 'no value'}; expected {what}: {_example(kind)}"
            )
    elif found["value"] is not None:
        raise ConfigError(f"--fault {text}: found a value; {kind} has none: {_example(kind)}")
    if length is not None and float(length) == 0:
        raise ConfigError(
            f"--fault {text}: found a duration of 0; leave +DURATION out for a fault that lasts to the end"
        )
    return Fault(kind, value, float(found["start"] or 0), None if length is None else float(length))


def _example(kind: str) -> str:
    value = "=0.01" if kind in SHARES else "=0.2" if kind in TIMES else ""
    return f"{kind}{value}@20+0.5"


def divided(faults: Iterable[Fault], *, simulated: bool) -> tuple[list[Fault], list[Fault]]:
    """Faults of the link, and those that the simulated controller has itself.

    Raises:
        ConfigError: a fault inside the controller, which is a real one.
    """
    link: list[Fault] = []
    device: list[Fault] = []
    for fault in faults:
        if fault.kind in DEVICE_ONLY and not simulated:
            raise ConfigError(
                f"--fault {fault}: happens inside the controller, which is not simulated; expected --backend sim, or "
                "the fault given to `bench serve`"
            )
        (device if simulated and fault.kind in (*DEVICE_ONLY, "mute") else link).append(fault)
    return link, device


def of_a_line(link: Sequence[Fault], device: Sequence[Fault]) -> tuple[list[Fault], list[Fault]]:
    """The same division for a simulated controller that knows what its line is made of: what hits single lines and blocks
    happens there, and only what cuts the link or holds it up beside it."""
    outside = [f for f in link if f.kind not in SHARES]
    return outside, [*(f for f in link if f.kind in SHARES), *device]


def announced(faults: Sequence[Fault]) -> Finding:
    """What the record of a run must say when its troubles were made."""
    return Finding("faults-injected", f"faults were injected on purpose: {', '.join(map(str, faults))}", "link")
