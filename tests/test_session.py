"""Sessions: there and back through the fields of Claim and Owner, whatever the name."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from bench.link.codec import Decoder, encode
from bench.link.frames import frame
from bench.link.session import PART_BYTES, PARTS, Session, new_session, who
from bench.rigfile import load_rig

U32 = st.integers(0, 2**32 - 1)
MESSAGES = load_rig("tsbs12").messages


def test_golden_fields() -> None:
    fields = Session(0x01020304, 1_767_225_600, "ann@lab pid 7").fields()
    assert fields["session"] == 0x01020304
    assert fields["name0"] == int.from_bytes(b"ann@la", "little") == 0x616C406E6E61
    assert fields["name2"] == ord("7")
    assert [fields[f"name{k}"] for k in range(3, 9)] == [0] * 6


def test_a_long_name_is_cut_between_characters() -> None:
    session = Session(1, 0, "x" * 53 + "é")
    assert Session.of({k: float(v) for k, v in session.fields().items()}).name == "x" * 53


@given(U32, U32, st.text(max_size=80))
def test_there_and_back_over_the_wire(number: int, since: int, name: str) -> None:
    sent = Session(number, since, name)
    payload = encode(MESSAGES["Claim"], sent.fields())
    values, _ = Decoder(MESSAGES["Claim"]).decode(frame(MESSAGES["Claim"].identifier, payload))
    got = Session.of({k: float(v[0]) for k, v in values.items()})
    assert (got.number, got.since, got.low_byte) == (number, since, number & 0xFF)
    whole = name.encode(errors="replace").decode()
    shown = "".join(c if c.isprintable() else "\ufffd" for c in whole.rstrip("\0"))
    assert shown.startswith(got.name) or not name.isprintable()
    if len(whole.encode()) <= PARTS * PART_BYTES:
        assert got.name == shown


@given(st.lists(st.integers(0, 2**48 - 1), min_size=PARTS, max_size=PARTS), U32)
def test_any_bytes_have_a_text_that_a_terminal_only_shows(parts: list[int], since: int) -> None:
    got = Session.of({"session": 5.0, "since": float(since), **{f"name{k}": float(v) for k, v in enumerate(parts)}})
    assert str(got).isprintable()


def test_an_owner_is_named_with_its_start() -> None:
    assert str(Session(0xABC, 1_767_225_600, "ann@lab")) == "ann@lab, session 0x00000abc, since 2026-01-01 00:00:00 UTC"
    assert str(Session(1, 0, "")).startswith("a host that gave no name")


def test_sessions_of_one_process_differ_and_have_a_low_byte() -> None:
    made = [new_session() for _ in range(300)]
    assert len({s.number for s in made}) > 290
    assert all(0 < s.number < 2**32 and s.low_byte for s in made)
    assert made[0].name == who()
