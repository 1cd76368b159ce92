"""Batches of payloads from values, against cantools on random message maps, and against the simulated machines' own bytes."""

from __future__ import annotations

import cantools
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_codec import LENGTHS, Placed, dbc_of, placed_signals

from bench.link.codec import Decoder
from bench.link.frames import empty_batch
from bench.link.payloads import Encoder, put, taken
from bench.rigfile import load_rig
from bench.rigfile.messages import Signal, load_messages
from sim_backend.controller.controller import SimulatedController
from sim_backend.truth import draw


def limits(s: Signal) -> tuple[float, float]:
    """What a signal can say, in its unit, in order."""
    low, high = (-(2 ** (s.length - 1)), 2 ** (s.length - 1) - 1) if s.signed else (0, 2**s.length - 1)
    a, b = low * s.scale + s.offset, high * s.scale + s.offset
    return min(a, b), max(a, b)


@st.composite
def cases(draw: st.DrawFn) -> tuple[str, list[list[float]]]:
    """A map, and rows of values for its signals: inside their ranges and beyond, where a float64 tells them apart."""
    size = draw(st.sampled_from(LENGTHS))
    dbc = dbc_of(size, draw(placed_signals(size)))
    rows = []
    for s in load_messages(dbc)["M"].signals:
        low, high = (-1e30, 1e30) if s.is_float else limits(s)
        room = 0.25 * (high - low)
        rows.append(draw(st.lists(st.floats(low - room, high + room), min_size=3, max_size=3)))
    return dbc, rows


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(cases())
def test_what_is_encoded_is_what_cantools_reads(case: tuple[str, list[list[float]]]) -> None:
    dbc, rows = case
    message = load_messages(dbc)["M"]
    encoder = Encoder(message)
    wanted = dict(zip((s.name for s in message.signals), rows, strict=True))
    payloads = encoder.table(np.array([wanted[name] for name in encoder.names]))
    theirs = cantools.database.load_string(dbc, database_format="dbc").get_message_by_name("M")
    for k in range(3):
        read = theirs.decode(payloads[k].tobytes())
        for s in message.signals:
            value = wanted[s.name][k]
            if not s.is_float:
                low, high = limits(s)
                value = min(max(value, low), high)
            exact = 2.0**-22 if s.is_float and s.length == 32 else 2.0**-50
            close = (
                (0.5 if not s.is_float else 0) * abs(s.scale)
                + exact * (abs(value) + abs(s.offset))
                + 1e-38 * s.is_float
            )
            assert abs(float(read[s.name]) - value) <= close * 1.0000001, (s, value, read[s.name])


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
def test_a_signals_bits_are_put_and_the_others_stay(data: st.DataObject) -> None:
    size = data.draw(st.sampled_from(LENGTHS))
    message = load_messages(dbc_of(size, data.draw(placed_signals(size))))["M"]
    before = np.frombuffer(data.draw(st.binary(min_size=2 * size, max_size=2 * size)), np.uint8).reshape(2, size)
    s = data.draw(st.sampled_from(message.signals))
    raw = np.array([data.draw(st.integers(0, 2**s.length - 1)) for _ in range(2)], np.uint64)
    after = before.copy()
    put(after, s, raw)
    assert (taken(after, s) == raw).all()
    for other in message.signals:
        if other.name != s.name:
            assert (taken(after, other) == taken(before, other)).all()
    put(after, s, taken(before, s))
    assert (after == before).all()


def test_what_is_no_number_and_what_is_beyond_every_number() -> None:
    encoder = Encoder(load_messages(dbc_of(1, [Placed(0, 8, True, False, False, "1", "0")]))["M"])
    assert encoder.table(np.array([[np.nan, np.inf, -np.inf, 254.5, 3.4]]))[:, 0].tolist() == [0, 255, 0, 254, 3]


@pytest.mark.parametrize("name", ["tsbs12", "amb5dof"])
def test_the_machines_own_telemetry_is_encoded_to_the_same_bytes(name: str) -> None:
    rig = load_rig(name)
    message = rig.messages["Telemetry"]
    batch = SimulatedController(rig, draw(rig, 3)).advance(2000, empty_batch(), 0)
    data = batch["data"][batch["id"] == message.identifier][:, : message.length]
    assert len(data) == 200
    assert (Encoder(message).table(Decoder(message).table(data)) == data).all()
