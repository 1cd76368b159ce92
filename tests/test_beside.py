"""Messages of a sample as one long one: bytes and values are those of the single messages, and what is counted comes round."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.link.beside import beside, name_in, width_of
from bench.link.codec import Decoder, encode
from bench.link.payloads import Encoder
from bench.rigfile import load_rig

PLAIN = load_rig(str(Path(__file__).resolve().parent.parent / "examples" / "own-controller" / "plainamb.toml"))
MESSAGES = [PLAIN.messages[name] for name in ("AmbSync", "AmbPos", "AmbCurX", "AmbCurY", "AmbRest")]
LONG, WIDTH = beside(MESSAGES), width_of(MESSAGES)
COUNTED = {"AmbSync": "SeqNo", **dict.fromkeys(["AmbPos", "AmbCurX", "AmbCurY", "AmbRest"], "Rolling")}


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**40), st.floats(-300.0, 300.0), st.floats(-16.0, 16.0))
def test_the_long_one_is_made_of_the_bytes_of_the_single_ones(number: int, x_um: float, current_mA: float) -> None:
    encoder = Encoder(LONG, [name_in(m, COUNTED[m.name]) for m in MESSAGES])
    values = np.zeros((len(encoder.names), 1))
    values[encoder.names.index("AmbPos.XA")] = x_um
    values[encoder.names.index("AmbCurX.IXA_pos")] = current_mA
    payload = encoder.table(values, np.full((len(MESSAGES), 1), number))[0]
    given_values = {"AmbPos": {"XA": x_um}, "AmbCurX": {"IXA_pos": current_mA}}
    for k, m in enumerate(MESSAGES):
        low_bits = number % (1 << m.signal(COUNTED[m.name]).length)
        alone = encode(m, {COUNTED[m.name]: low_bits, **given_values.get(m.name, {})})
        assert payload[WIDTH * k : WIDTH * k + m.length].tobytes() == alone, m.name


@settings(max_examples=50, deadline=None)
@given(st.binary(min_size=WIDTH * len(MESSAGES), max_size=WIDTH * len(MESSAGES)))
def test_the_long_one_reads_as_the_single_ones_do(payload: bytes) -> None:
    whole = Decoder(LONG).decode_payloads(np.frombuffer(payload, np.uint8)[None])
    for k, m in enumerate(MESSAGES):
        alone = Decoder(m).decode_payloads(np.frombuffer(payload, np.uint8)[None, WIDTH * k : WIDTH * k + m.length])
        for name, value in alone.items():
            np.testing.assert_array_equal(whole[name_in(m, name)], value)
