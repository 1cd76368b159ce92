"""Register maps of Modbus devices, as a rig file states them: where a value lies, how its words make a number, and how
reads are grouped into few requests."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from bench import units
from bench.errors import ConfigError, LinkError
from bench.rigfile.part import Part
from bench.rigfile.toleranced import UNKNOWN_UNIT

Table = Literal["holding", "input"]
WordOrder = Literal["big", "little"]
Words = tuple[int, ...]

GAP, LONGEST = 8, 120
"""Registers that a grouped read may skip over, and the most that it takes (Modbus allows 125)."""
EXCEPTIONS = {1: "illegal function", 2: "illegal data address", 3: "illegal data value", 4: "device failure",
              5: "acknowledged, not done", 6: "device busy", 8: "memory parity error", 10: "gateway has no path",
              11: "gateway's device does not answer"}  # fmt: skip
"""Exception codes of Modbus Application Protocol 1.1b3, section 7."""
RANGES = {"u16": (0, 0xFFFF), "i16": (-0x8000, 0x7FFF), "u32": (0, 0xFFFF_FFFF), "i32": (-0x8000_0000, 0x7FFF_FFFF),
          "f32": (-math.inf, math.inf)}  # fmt: skip
"""Raw values that a type can hold."""


class RegisterRefused(LinkError):
    """A device answered with an exception response; `code` is the protocol's."""

    def __init__(self, code: int, where: str) -> None:
        super().__init__(f"{where}: exception {code} ({EXCEPTIONS.get(code, 'not in the protocol')})")
        self.code, self.where = code, where


class RegisterPort(Protocol):
    """One Modbus device, real or in-process."""

    def read(self, table: Table, address: int, count: int) -> Words:
        """`count` registers from `address` on.

        Raises:
            RegisterRefused: the device answers with an exception.
            LinkError: it does not answer, or not with what was asked.
        """
        ...

    def write(self, address: int, words: Words) -> None:
        """Write holding registers; raises as `read` does."""
        ...


class Bounds(Part):
    """What a reading may be at least and at most, SI, and when; by default positions and the supply while the rotor is held,
    all others always."""

    low: float | None = None
    high: float | None = None
    when: Literal["always", "held"] | None = None


class Register(Part):
    """One value: value = raw * scale + offset in `unit`. 32-bit types take two registers, words in the device's order.
    `protect` and `unprotected` as a channel's."""

    address: int = Field(ge=0, le=65535)
    type: Literal["u16", "i16", "u32", "i32", "f32"] = "u16"
    table: Table = "holding"
    scale: float = 1.0
    offset: float = 0.0
    unit: str = "1"
    writable: bool = False
    about: str = ""
    protect: Bounds | None = None
    unprotected: str = ""

    @model_validator(mode="after")
    def _usable(self) -> Register:
        try:
            units.unit(self.unit)
        except ConfigError as error:  # reported with its key and next to the other problems
            raise PydanticCustomError(UNKNOWN_UNIT, "unknown unit '{symbol}'", {"symbol": self.unit}) from error
        if self.scale == 0:
            raise ValueError("expected a scale that is not zero")
        if self.writable and self.table == "input":
            raise ValueError("input registers cannot be written; expected table = 'holding'")
        if self.address + self.count > 65536:
            raise ValueError("expected an address that leaves room for two registers")
        return self

    @cached_property
    def count(self) -> int:
        """Registers it takes."""
        return 1 if self.type in ("u16", "i16") else 2

    @cached_property
    def _unit(self) -> units.Unit:
        return units.unit(self.unit)

    def words(self, value: float, order: WordOrder = "big") -> Words:
        """The registers of a value in SI.

        Raises:
            ValueError: it does not fit the type; nothing is clipped.
        """
        raw = ((value - self._unit.offset) / self._unit.factor - self.offset) / self.scale
        if not math.isfinite(raw):
            raise ValueError(f"{value!r} is no number that a register can hold")
        return self.raw_words(raw if self.type == "f32" else round(raw), order)

    def raw_words(self, raw: float, order: WordOrder = "big") -> Words:
        """The registers of a raw value, as commands state it.

        Raises:
            ValueError: it does not fit the type.
        """
        try:
            bits = int.from_bytes(struct.pack(">f", raw), "big") if self.type == "f32" else int(raw)
        except (OverflowError, ValueError):
            raise ValueError(f"raw value {raw!r} does not fit {self.type}") from None
        low, high = RANGES[self.type]
        if self.type != "f32" and (bits != raw or not low <= bits <= high):
            raise ValueError(f"raw value {raw!r} does not fit {self.type}")
        if self.count == 1:
            return (bits & 0xFFFF,)
        first, last = bits >> 16 & 0xFFFF, bits & 0xFFFF
        return (first, last) if order == "big" else (last, first)

    def raw(self, words: Sequence[int], order: WordOrder = "big") -> float:
        """The raw value of its registers; may be NaN or infinite where the type is f32."""
        if self.count == 1:
            bits, top = words[0], 0x8000
        else:
            first, last = words if order == "big" else words[::-1]
            bits, top = first << 16 | last, 0x8000_0000
        if self.type == "f32":
            found: float = struct.unpack(">f", bits.to_bytes(4, "big"))[0]
            return found
        return bits - 2 * top if bits >= top and self.type in ("i16", "i32") else bits

    def value(self, words: Sequence[int], order: WordOrder = "big") -> float:
        """The value of its registers in SI.

        Raises:
            ValueError: the registers hold no finite number.
        """
        found = (self.raw(words, order) * self.scale + self.offset) * self._unit.factor + self._unit.offset
        if not math.isfinite(found):
            raise ValueError(f"registers {' '.join(f'{w:04x}' for w in words)} hold no finite number")
        return found


@dataclass(frozen=True)
class Block:
    """Registers that one request reads."""

    table: Table
    address: int
    count: int
    names: tuple[str, ...]


def grouped(registers: Mapping[str, Register], gap: int = GAP, longest: int = LONGEST) -> tuple[Block, ...]:
    """Few requests that read all of `registers`: neighbours with at most `gap` unused registers between them share one,
    up to `longest`. With a gap below zero each register has its own."""
    blocks: list[Block] = []
    for name, r in sorted(registers.items(), key=lambda item: (item[1].table, item[1].address, item[0])):
        last = blocks[-1] if blocks else None
        if last is not None and gap >= 0 and last.table == r.table:
            end = max(last.address + last.count, r.address + r.count)
            if r.address <= last.address + last.count + gap and end - last.address <= longest:
                blocks[-1] = Block(last.table, last.address, end - last.address, (*last.names, name))
                continue
        blocks.append(Block(r.table, r.address, r.count, (name,)))
    return tuple(blocks)


def values_of(
    block: Block, words: Sequence[int], registers: Mapping[str, Register], order: WordOrder
) -> dict[str, float]:
    """Values in SI by name from what a block's request brought.

    Raises:
        ValueError: a register holds no finite number; the text names it.
    """
    out = {}
    for name in block.names:
        r = registers[name]
        at = r.address - block.address
        try:
            out[name] = r.value(words[at : at + r.count], order)
        except ValueError as error:
            raise ValueError(f"register {name}: {error}") from None
    return out
