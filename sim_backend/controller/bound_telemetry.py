"""Telemetry by any DBC: readings to the messages that the rig file's binding names, a whole batch at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench import units
from bench.link.beside import beside, name_in, width_of
from bench.link.frames import FD, FRAME, FrameBatch, empty_batch
from bench.link.payloads import Encoder
from bench.rigfile import RigFile
from bench.rigfile.busload import frame_seconds
from bench.rigfile.elements import Mark
from bench.rigfile.messages import Message, MessageMap
from sim_backend.controller.controls import meanings
from sim_backend.controller.meanings import fault_codes, state_codes
from sim_backend.controller.states import HELD
from sim_backend.controller.telemetry import Readings, Span, kept
from sim_backend.machine import PLANTED_S, Machine, SimulatedPlant, Truth
from sim_backend.spoken import CONTROLLER, bits, bits_of, tellable, told_as, warming

Ints = npt.NDArray[np.int64]
FLAGS = "flags"  # the status word of a machine that is not made of the rig file
CODES = ("state", "fault", FLAGS)  # whole numbers that stand for themselves


@dataclass(frozen=True)
class _Layout:
    """All telemetry messages of a sample as one long one: its encoder; the channels' rows in its table with the places of their
    readings, factors and offsets to the signals' units, and how each comes round (0: it does not); places of the codes, the
    first of what is counted."""

    encoder: Encoder
    rest: npt.NDArray[np.float64]  # what signals say that nothing is bound to: raw zero
    rows: list[int]
    columns: list[int]
    factors: npt.NDArray[np.float64]
    offsets: npt.NDArray[np.float64]
    rounds: npt.NDArray[np.float64]
    codes: list[int]


class BoundTelemetry:
    """Makes the messages of every sample: sequence and tick in the first, its low bits in the others, which follow each other
    as the bit rate allows.

    Args:
        rig: with channels and binding.
        messages: the device's own map.
        truth: of the machine.
        plant: whose rows are told.
    """

    def __init__(self, rig: RigFile, messages: MessageMap, truth: Truth, plant: SimulatedPlant) -> None:
        machine, self._mark = truth.machine, rig.mark or Mark()
        self._known = tellable(rig, machine)
        names = tuple(dict.fromkeys((*machine.channels, *sorted(self._known), *CONTROLLER)))
        self._place = {name: k for k, name in enumerate(names)}
        codes = {
            "state": state_codes(rig.binding, rig.choices("state")),
            "fault": fault_codes(rig, rig.choices("fault")),
        }
        columns = None if machine.columns is None else machine.columns(rig)
        self._readings = Readings(
            truth, self._place, codes, plant.period_ticks, plant.tick_s, columns, warming(rig, machine)
        )
        self._word = [] if columns is not None else list(self._told_elsewhere(rig, machine))
        said = {} if columns is None else bits(rig)
        self._bits = [(self._place[name], bit) for name, bit in said.items() if name in self._place]
        self._codes = {*CODES, *(bit.channel for bit in bits(rig).values())}
        planted = {n: v for n, v in truth.planted().items() if n in rig.channels}
        self._planted = {self._place[told_as(rig, n, self._known) or n]: v for n, v in planted.items()}
        self._held_from: int | None = None
        self._tick_ns = round(plant.tick_s * 1e9)
        self._truth, self._sequence = truth, plant.tick // plant.period_ticks
        told = [messages[name] for name in rig.binding.telemetry]
        self._layout, self._width = self._laid_out(rig, told), width_of(told)
        self._head = np.zeros(len(told), FRAME)  # of a sample's frames, what is the same in each
        self._head["id"], self._head["length"] = [m.identifier for m in told], [m.length for m in told]
        self._head["flags"] = [FD if m.fd else 0 for m in told]
        seconds = [frame_seconds(m, rig.link.bitrate, rig.link.data_bitrate) if rig.link.bitrate else 0.0 for m in told]
        self._head["t_ns"] = np.rint(np.cumsum([0.0, *seconds[1:]]) * 1e9)

    def _told_elsewhere(self, rig: RigFile, machine: Machine) -> Iterator[tuple[int, int, int]]:
        """Of a machine that has a status word of its own, where the rig file has other bits for it: the word's bits, the place
        where they are told, and the bits there."""
        own = bits_of(meanings(rig, machine))
        told = {
            name: (self._place[told_as(rig, bit.channel, self._known) or FLAGS], bit.mask or 1)
            for name, bit in bits(rig).items()
        }
        if any(told[name] != (self._place[FLAGS], own[name].mask) for name in told if name in own):
            yield from ((own[name].mask or 0, *where) for name, where in told.items() if name in own)

    def _laid_out(self, rig: RigFile, messages: list[Message]) -> _Layout:
        whole, b, owners = beside(messages), rig.binding, {m.name for m in messages}
        told: list[tuple[str, int, float, float, float]] = []
        codes: dict[str, int] = {}
        for name, channel in rig.channels.items():
            reading = told_as(rig, name, self._known)
            if channel.signal.partition(".")[0] not in owners or reading is None:
                continue
            if name in self._codes:
                codes[channel.signal] = self._place[reading]
                continue
            s = whole.signal(channel.signal)
            unit = units.UNITS[s.unit]
            around = float(2**s.length) * abs(s.scale) if name in (self._mark.pulses, self._mark.edge) else 0.0
            if name == self._mark.angle and not s.signed and s.offset >= 0:
                around = 2 * np.pi / unit.factor
            told.append((channel.signal, self._place[reading], unit.factor, unit.offset, around))
        counted = [name_in(messages[0], b.tick), name_in(messages[0], b.sequence)]
        encoder = Encoder(whole, [*codes, *counted, *(name_in(m, b.counter) for m in messages[1:])])
        rest = np.array([whole.signal(n).offset for n in encoder.names])[:, None]
        rows, columns = [encoder.names.index(x[0]) for x in told], [x[1] for x in told]
        factors, offsets, rounds = np.array([x[2:] for x in told]).reshape(len(told), 3).T[:, :, None]
        return _Layout(encoder, rest, rows, columns, factors, offsets, rounds, list(codes.values()))

    def encode(self, spans: list[Span], clock: tuple[int, int]) -> FrameBatch:
        """Frames for what ran, in order of their times, some of them a little after it: as `TelemetryEncoder.encode`."""
        n = sum(len(s.rows) for s in spans)
        if not n:
            return empty_batch()
        ticks, values = self._readings.of(spans, n)
        for column, bit in self._bits:
            values[:, self._place[bit.channel]] += (bit.mask or 1) * (values[:, column] != 0)
        if self._word:
            word = values[:, self._place[FLAGS]].astype(np.int64)
            values[:, [place for _, place, _ in self._word]] = 0.0
            for own, place, mask in self._word:
                values[:, place] += mask * ((word & own) != 0)
        if self._planted:
            self._plant(values, ticks, np.repeat([s.state in HELD for s in spans], [len(s.rows) for s in spans]))
        sequence = np.arange(self._sequence, self._sequence + n)
        self._sequence += n
        batch = np.tile(self._head, (n, 1))
        batch["t_ns"] += (clock[0] + (ticks - clock[1]) * self._tick_ns)[:, None]
        payloads = self._payloads(values, sequence, ticks)
        batch["data"][:, :, : self._width] = payloads.reshape(n, len(self._head), self._width)
        return kept(batch, sequence, self._truth).reshape(-1)

    def _plant(self, values: npt.NDArray[np.float64], ticks: Ints, held: npt.NDArray[np.bool_]) -> None:
        """Readings that are planted, from when the shaft is held first."""
        if self._held_from is None and held.any():
            self._held_from = int(ticks[held][0])
        if self._held_from is not None:
            told = held & (ticks < self._held_from + PLANTED_S * 1e9 / self._tick_ns)
            for place, value in self._planted.items():
                values[told, place] = value

    def _payloads(self, values: npt.NDArray[np.float64], sequence: Ints, ticks: Ints) -> npt.NDArray[np.uint8]:
        of = self._layout
        table = np.repeat(of.rest, len(values), axis=1)
        told = (values[:, of.columns].T - of.offsets) / of.factors
        around = of.rounds[:, 0] > 0
        told[around] %= of.rounds[around]
        table[of.rows] = told
        counts = np.empty((len(of.codes) + 1 + len(self._head), len(values)), np.int64)
        counts[: len(of.codes)] = values[:, of.codes].T
        counts[len(of.codes)], counts[len(of.codes) + 1 :] = ticks, sequence
        return of.encoder.table(table, counts)
