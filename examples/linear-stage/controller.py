"""A linear stage of another laboratory: its controller behind an SLCAN adapter on TCP, chariot.dbc packed by hand, and who
reads its interferometer. It knows nothing of Levbench. 5 kg on a screw, with friction; a PID at 2 kHz, a set point on a ramp.

    python controller.py [BUS TABLE]    # ports, 0: any that is free; prints both
"""

from __future__ import annotations

import contextlib
import math
import random
import select
import socket
import struct
import sys
import threading
import time

ARRET, PRET, ORIGINE, TENU, VA, FREINE, DEFAUT = range(7)
MASS, RUB, VISCOUS, NEWTON_PER_A = 5.0, 0.5, 20.0, 12.0
KP, KI, KD = 80_000.0, 6e6, 1_300.0
TICK_S, TELEMETRY_TICKS, RAMP = 5e-4, 4, 0.05
STILL, TURN = 1000, 5e-3  # ticks without a heartbeat; of the screw, m
SCALE, WAVE = 25e-6, 1.5e-6  # the screw is too long by so much, and errs so far once a turn, m
PLAY, SEAT = 0.2e-6, 0.03e-6  # half the reversal; what each arrival differs by, m
LASER = 2e-8  # noise of the interferometer, m


class Axe:
    def __init__(self) -> None:
        self.mode, self.fault, self.homed = ARRET, 0, False
        self.x, self.v, self.target, self.wanted, self.sum = 3e-3, 0.0, 0.0, 0.0, 0.0
        self.tick = self.number = 0
        self.since, self.heard, self.current = 0, -1, 0.0
        self.noise = random.Random(7)
        self.way, self.seat, self.then = 1.0, 0.0, TENU

    def send(self, place: float) -> None:
        """A set point; where it is another one, the table will sit a little otherwise."""
        if place != self.target:
            self.way, self.seat = math.copysign(1.0, place - self.target), self.noise.gauss(0, SEAT)
        self.target = max(-0.14, min(0.14, place))

    def order(self, code: int) -> None:
        if code == 1 and self.mode == ARRET:
            self.mode = PRET
        elif code == 2 and self.mode in (PRET, DEFAUT):
            self.mode = ARRET
        elif code == 3 and self.mode == PRET:
            self.mode, self.since = ORIGINE, self.tick
            self._hold()
        elif code == 4 and self.mode == PRET and self.homed:
            self.mode = TENU
            self._hold()
        elif code == 5 and self.mode in (TENU, VA):
            self.mode = PRET
        elif code in (6, 7) and self.mode in (TENU, VA):
            self.mode, self.since, self.then = FREINE, self.tick, TENU if code == 6 else ARRET
        elif code in (6, 7) and self.mode == ORIGINE:
            self.mode = PRET if code == 6 else ARRET
        elif code == 7 and self.mode == PRET:
            self.mode = ARRET
        elif code == 8 and self.mode == DEFAUT:
            self.mode, self.fault = ARRET, 0

    def _hold(self) -> None:
        self.target = self.wanted = self.x
        self.sum = 0.0

    def step(self) -> None:
        self.tick += 1
        if self.heard >= 0 and self.tick - self.heard > STILL and self.mode not in (ARRET, PRET, DEFAUT):
            self.mode, self.fault, self.heard = DEFAUT, 3, -1
        force = 0.0
        if self.mode in (ORIGINE, TENU, VA, FREINE):
            if self.mode == ORIGINE:
                self.target = 0.0
            if self.mode == FREINE:
                self.target = self.wanted
            gone = max(-RAMP * TICK_S, min(RAMP * TICK_S, self.target - self.wanted))
            self.wanted += gone
            seen = round(self.x / 1e-7) * 1e-7
            off = self.wanted - seen
            if gone == 0.0:
                self.sum += off * TICK_S
            force = KP * off + KI * self.sum + KD * (gone / TICK_S - self.v)
            force = max(-50.0, min(50.0, force))
            if self.mode in (TENU, VA):
                self.mode = VA if self.wanted != self.target else TENU
            if self.mode == ORIGINE and self.wanted == 0.0 and self.tick - self.since > 3000:
                self.mode, self.homed = PRET, True
            if self.mode == FREINE and self.tick - self.since > 400:
                self.mode = self.then
        self.current = force / NEWTON_PER_A
        free = force - VISCOUS * self.v
        if self.v == 0.0 and abs(free) <= RUB:
            return
        way = math.copysign(1.0, self.v if self.v != 0.0 else free)
        v = self.v + (free - way * RUB) / MASS * TICK_S
        self.v = 0.0 if self.v != 0.0 and v * self.v < 0 else v
        self.x += self.v * TICK_S

    def frames(self) -> bytes:
        self.number = self.number + 1 & 0xFFFF
        first = struct.pack(">HIBB", self.number, self.tick & 0xFFFFFFFF, self.mode << 4 | self.fault, self.homed << 7)
        at, to = (round(x / 1e-8) & 0xFFFFFFF for x in (round(self.x / 1e-7) * 1e-7, self.wanted))
        second = (self.number & 0xFF) << 56 | at << 28 | to
        current = round((self.current + self.noise.gauss(0, 2e-3)) / 5e-4)
        third = struct.pack(">Bhh", self.number & 0xFF, current, round(self.v / 5e-5))
        return b"".join((line(0x201, first), line(0x202, struct.pack(">Q", second)), line(0x203, third)))


def line(identifier: int, data: bytes) -> bytes:
    return b"t%03X%d%s\r" % (identifier, len(data), data.hex().upper().encode())


def truth(seen: float) -> float:
    """Where the table is when its encoder, on the screw, tells that place."""
    return seen * (1 + SCALE) + WAVE * math.sin(2 * math.pi * seen / TURN)


def watch(axe: Axe, place: socket.socket) -> None:
    """Who reads the interferometer beside the stage."""
    noise = random.Random(3)
    while True:
        host, _ = place.accept()
        with host, host.makefile("rw", encoding="utf-8", newline="\n") as lines:
            for one in lines:
                shown = truth(axe.x) + PLAY * axe.way + axe.seat + noise.gauss(0, LASER)
                answer = f"ok 0.2 {shown * 1e6:.2f} um" if one.strip() == "read s" else "ok"
                lines.write(answer + "\n")
                lines.flush()


def serve(axe: Axe, place: socket.socket) -> None:
    while True:
        host, _ = place.accept()
        host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with contextlib.suppress(OSError):  # a bench that is gone
            attend(axe, host)
        host.close()


def attend(axe: Axe, host: socket.socket) -> None:
    rest, begun, first, asked = b"", time.monotonic(), axe.tick, 0
    opened = False
    while True:
        ready, _, _ = select.select([host], [], [], 1e-3)
        if ready:
            data = host.recv(65536)
            if not data:
                return
            *lines, rest = (rest + data).split(b"\r")
            for one in lines:
                kind = one[:1]
                if kind == b"t":
                    identifier, payload = int(one[1:4], 16), bytes.fromhex(one[5 : 5 + 2 * int(one[4:5])].decode())
                    if identifier == 0x50:
                        axe.heard = axe.tick
                    elif identifier == 0x51:
                        if payload[0] != asked:
                            axe.order(payload[0])
                        asked = payload[0]
                    elif identifier == 0x52:
                        axe.send(struct.unpack(">i", payload)[0] * 1e-8)
                    host.sendall(b"z\r")
                elif kind == b"V":
                    host.sendall(b"V1013\r")
                elif kind == b"N":
                    host.sendall(b"N0042\r")
                elif kind in (b"S", b"O", b"C", b"L", b"M", b"Z", b"Y"):
                    opened = kind in (b"O", b"L") or (opened and kind not in (b"C",))
                    host.sendall(b"\r")
                else:
                    host.sendall(b"\a")
        out = b""
        while axe.tick < first + (time.monotonic() - begun) / TICK_S:
            axe.step()
            if axe.tick % TELEMETRY_TICKS == 0 and opened:
                out += axe.frames()
        if out:
            host.sendall(out)


if __name__ == "__main__":
    bus, desk = (socket.create_server(("127.0.0.1", int(port))) for port in (sys.argv[1:3] or (0, 0)))
    sys.stdout.write(f"{bus.getsockname()[1]} {desk.getsockname()[1]}\n")
    sys.stdout.flush()
    stage = Axe()
    threading.Thread(target=watch, args=(stage, desk), daemon=True).start()
    serve(stage, bus)
