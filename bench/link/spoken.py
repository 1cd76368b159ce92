"""What a host's message is on a command line, as the rig file's table `commandline` has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bench.errors import ConfigError
from bench.link.codec import Decoder
from bench.rigfile import RigFile
from bench.rigfile.commandline import filled

CAPTURE = ("CaptureArm", "CaptureAsk", "CaptureRead")


@dataclass(frozen=True)
class Said:
    """A message of the host: its name and values, the parameter that it concerns, and its line; None: it is not said, the bench
    holds the value itself."""

    message: str
    values: Mapping[str, float]
    key: str = ""
    line: str | None = None


class Speaker:
    """Makes lines of messages.

    Args:
        rig: with a table `commandline`.

    Raises:
        ConfigError: it has none.
    """

    def __init__(self, rig: RigFile) -> None:
        if rig.commandline is None:
            raise ConfigError(
                f"rig {rig.name}: found no table [commandline]; expected one that says how its messages are said"
            )
        self._rig, self._lines = rig, rig.commandline
        self._decoders = {m.identifier: Decoder(m) for m in rig.messages.messages.values()}
        self._keys = {p.index: key for key, p in rig.parameters.items() if p.index is not None}
        self.held = {key: p.default for key, p in rig.parameters.items()}
        """Values of the parameters as they were last set, SI."""

    def said(self, identifier: int, payload: bytes) -> Said | None:
        """What a frame is on the line; None for one that has none."""
        decoder = self._decoders.get(identifier)
        if decoder is None or len(payload) != decoder.message.length:
            return None
        name, values = decoder.message.name, decoder.decode_one(payload)
        if name == self._rig.binding.heartbeat:
            counter = f"{values[self._rig.binding.heartbeat_counter]:.0f}"
            return Said(name, values, line=filled(self._lines.heartbeat, {"counter": counter}))
        if name == "Command":
            word = decoder.message.signal("code").choices.get(int(values["code"]), "")
            return Said(name, values, word, self._lines.commands.get(word))
        if name in ("ParamSet", "ParamGet"):
            key = self._keys.get(int(values["index"]), "")
            return Said(name, values, key, self._parameter(key, values.get("value")) if key else None)
        if name in CAPTURE and self._lines.capture is not None:
            return Said(name, values, line=self._capture(name, values))
        return None

    def value(self, key: str) -> str:
        """What stands for a parameter in a line: its value, or the word for it."""
        words, value = self._lines.of(key).words, self.held[key]
        k = round(value)
        return words[k] if words and 0 <= k < len(words) and k == value else f"{value:.9g}"

    def _parameter(self, key: str, value: float | None) -> str | None:
        spoken = self._lines.of(key)
        if value is None:
            return self._filled(spoken.get, key) if spoken.get else None
        self.held[key] = value
        line = spoken.at.get(f"{value:.9g}", spoken.set)
        return self._filled(line, key) if line else None

    def _filled(self, line: str, key: str) -> str:
        values = {k: self.value(k) for k in self.held}
        return filled(line, {**values, "key": key, "value": values[key]})

    def _capture(self, name: str, v: Mapping[str, float]) -> str:
        lines = self._lines.capture
        assert lines is not None
        if name == "CaptureRead":
            return filled(lines.read, {"offset": f"{v['offset']:.0f}", "length": f"{v['length']:.0f}"})
        if name == "CaptureAsk":
            return lines.cancel if self._rig.messages.code(name, "code", "CANCEL") == v["code"] else lines.state
        kind = self._rig.messages[name].signal("trigger").choices.get(int(v["trigger"]), "")
        assert self._rig.capture is not None
        named = {c.index: lines.called.get(n, n) for n, c in self._rig.capture.channels.items()}
        watched = {"channel": named.get(int(v["source"]), ""), "level": f"{v['level']:.9g}"}
        return filled(lines.arm, {
            "channels": f"{int(v['channels0']) | int(v['channels1']) << 32:x}",
            "rate": f"{1 / (v['divider'] * self._rig.devices['controller'].tick_s):.0f}",
            "length": f"{v['length']:.0f}", "before": f"{v['before']:.0f}",
            "trigger": filled(lines.triggers.get(kind, kind), watched),
        })  # fmt: skip
