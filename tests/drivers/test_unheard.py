"""What is said of a link that brings no telemetry: nothing comes, bytes that are no messages, or other messages."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.errors import BytesUnreadable, LinkError
from bench.link import LinkStats
from bench.link.slcanstream import SlcanStream
from drivers import unheard
from drivers.unheard import Heard


class Told:
    """A link of which the counts are known."""

    name = "controller"

    def __init__(self, **counts: int) -> None:
        self.stats = LinkStats(**counts)


BEFORE = Heard(1000, 20, 3, 4)


def said(**more: int) -> LinkError:
    counts = {"octets": 1000, "received": 20, "malformed": 3, "crc_errors": 4}
    link = Told(**{name: n + more.get(name, 0) for name, n in counts.items()})
    return unheard.error(link, BEFORE, 1.5, "no telemetry within 1.5 s")  # type: ignore[arg-type]


@pytest.mark.parametrize("octets", [0, 1, 3])
def test_nothing_comes(octets: int) -> None:
    error = said(octets=octets)
    assert type(error) is LinkError
    assert str(error) == "link controller: no telemetry within 1.5 s"


def test_bytes_that_are_no_messages_are_told_with_their_number_and_their_rate() -> None:
    error = said(octets=300_000, malformed=1172, crc_errors=2)
    assert isinstance(error, BytesUnreadable)
    assert "300000 bytes came in 1.5 s (200.0 kB/s), but no message can be made of them" in str(error)
    assert "of them: 1172 pieces that are no message, 2 with a wrong CRC." in str(error)
    assert "no telemetry" not in str(error)


def test_bytes_of_which_no_piece_has_ended_yet() -> None:
    assert "15 bytes came in 1.5 s (0.0 kB/s), but no message can be made of them. Next:" in str(said(octets=15))


def test_other_messages_are_no_noise() -> None:
    error = said(octets=5000, received=30)
    assert type(error) is LinkError
    assert str(error).endswith("no telemetry within 1.5 s. 30 other messages came meanwhile")


@given(st.lists(st.sampled_from([b"z\r", b"Z\r", b"\r", b"\a", b"F00\r", b"V1013\r", b"N0001\r"])))
def test_what_an_adapter_answers_is_not_heard_as_noise(lines: list[bytes]) -> None:
    stream, data = SlcanStream(), b"".join(lines)
    stream.feed(data, 0)
    assert stream.malformed == 0
    assert stream.answered == len(data)


@given(st.binary(max_size=200))
def test_what_is_no_line_is_heard(data: bytes) -> None:
    stream = SlcanStream()
    stream.feed(data, 0)
    assert 0 <= stream.answered <= len(data)
