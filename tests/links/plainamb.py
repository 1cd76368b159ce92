"""A stand-in for a controller with a message map of its own: it translates, by hand, between the bytes of
examples/own-controller/plainamb.dbc and those of the simulated tsbs12. It knows neither DBC."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from bench.link import Link, LinkStats
from bench.link.frames import FD, FRAME, SENT, FrameBatch, empty_batch, frame, payload

TELEMETRY, HEARTBEAT, COMMAND, PARAM_SET, CLAIM = 0x100, 0x010, 0x011, 0x012, 0x014
COMMAND_REPLY, PARAM_REPLY = 0x021, 0x022
HOST_CONTROL, HOST_TUNING = 32, 33
SYNC, DATA = 128, (144, 145, 146, 147)
DEMANDS = {0: 0, 1: 1, 2: 2, 3: 3, 4: 4, 5: 5, 6: 7, 7: 6}  # Demand to Command.code
BIAS, ANGLE_REF, SPEED_REF = (1, 2, 3), 30, 35
SESSION = 1
Ints = npt.NDArray[np.int64]


class PlainAmb:
    """The link to the stand-in. `heard` gets the native telemetry before it is translated; `refused` are requests that
    the machine did not carry out, `demands` what the host asked for."""

    def __init__(self, native: Link, heard: Callable[[FrameBatch], None]) -> None:
        self._native, self._heard = native, heard
        self.name = native.name
        self._tuned: dict[int, int] = {}
        self._say(CLAIM, struct.pack("<I60x", SESSION))  # it obeys this one host, whoever that is
        self.demands: list[int] = []
        self.refused: list[bytes] = []

    @property
    def stats(self) -> LinkStats:
        return self._native.stats

    @property
    def reopening(self) -> bool:
        return self._native.reopening

    def renew_lease(self) -> None:
        self._native.renew_lease()

    def close(self) -> None:
        self._native.close()

    def send(self, batch: FrameBatch) -> None:
        """The host's messages: values that changed become parameters, a demand that changed becomes a command."""
        for one in batch:
            data = payload(one)
            assert not one["flags"] & FD
            if one["id"] == HOST_TUNING:
                assert len(data) == 6
                for index, milliamperes in zip(BIAS, struct.unpack("<HHH", data), strict=True):
                    self._tune(index, milliamperes, milliamperes * 1e-3)
            else:
                assert (int(one["id"]), len(data)) == (HOST_CONTROL, 8)
                demand, speed, angle = struct.unpack("<Bhix", data)
                self._tune(SPEED_REF, speed, speed * 0.1 * 2 * math.pi / 60)
                self._tune(ANGLE_REF, angle, math.radians(angle * 0.01))
                if not self.demands or demand != self.demands[-1]:
                    self.demands.append(demand)
                    self._say(COMMAND, struct.pack("<IBBH", SESSION, DEMANDS[demand], 0, 0))

    def _tune(self, index: int, raw: int, value: float) -> None:
        if self._tuned.get(index) != raw:
            self._tuned[index] = raw
            self._say(PARAM_SET, struct.pack("<HfBB", index, value, 0, SESSION))

    def _say(self, identifier: int, data: bytes) -> None:
        self._native.send(frame(identifier, data, flags=FD | SENT))

    def receive(self) -> FrameBatch:
        batch = self._native.receive()
        self._heard(batch)
        for one in batch[np.isin(batch["id"], (COMMAND_REPLY, PARAM_REPLY))]:
            data = payload(one)
            if data[2]:
                self.refused.append(data)
        return translated(batch[batch["id"] == TELEMETRY])


def translated(batch: FrameBatch) -> FrameBatch:
    """Five messages for each native one, in order."""
    if not len(batch):
        return empty_batch()
    data = np.ascontiguousarray(batch["data"])
    tick = np.ascontiguousarray(data[:, 2:6]).view("<u4")[:, 0].astype(np.int64)
    word = data.view("<i2").astype(np.int64)  # seq, tick, tick, pos x 5, angle, speed, coils x 10, ...
    code = data.view("<u2").astype(np.int64)
    seq, positions, angle, speed, coils = code[:, 0], word[:, 3:7], word[:, 8], word[:, 9], word[:, 10:20]
    state, fault, flags = code[:, 28], code[:, 29], code[:, 30]
    coils = np.rint(coils * 0.5).astype(np.int64)  # 0.5 mA to 1 mA
    degrees, rpm = angle * (360 / 65536), speed * (0.005 * 60 / (2 * math.pi))
    rest = [coils[:, 8], np.rint(degrees / 0.02), np.rint(rpm / 0.1), code[:, 26] - 27315]  # 0.01 K to 0.01 degC
    sync = seq | tick << 16 | state << 48 | fault << 52
    out = np.zeros((len(batch), 5), FRAME)
    out["t_ns"], out["length"] = batch["t_ns"][:, None], 8
    out["id"] = (SYNC, *DATA)
    words = [
        (sync.astype(np.uint64) | flags.astype(np.uint64) << np.uint64(56)).astype("<u8"),
        little(seq, *np.rint(positions * 0.8).astype(np.int64).T),  # 20 nm to 25 nm
        big(seq, *coils[:, [0, 1, 4, 5]].T),
        big(seq, *coils[:, [2, 3, 6, 7]].T),
        little(seq, *(x.astype(np.int64) for x in rest)),
    ]
    for k, w in enumerate(words):
        out["data"][:, k, :8] = np.ascontiguousarray(w).view(np.uint8).reshape(-1, 8)
    return out.reshape(-1)


def little(seq: Ints, *values: Ints) -> npt.NDArray[np.uint64]:
    """Four bits of the sequence, then four numbers of 15 bits, from the least significant bit on."""
    word = (seq & 0xF).astype(np.uint64)
    for k, v in enumerate(values):
        word |= (v & 0x7FFF).astype(np.uint64) << np.uint64(4 + 15 * k)
    return word.astype("<u8")


def big(seq: Ints, *values: Ints) -> npt.NDArray[np.uint64]:
    """The same from the most significant bit on."""
    word = (seq & 0xF).astype(np.uint64) << np.uint64(60)
    for k, v in enumerate(values):
        word |= (v & 0x7FFF).astype(np.uint64) << np.uint64(45 - 15 * k)
    return word.astype(">u8")
