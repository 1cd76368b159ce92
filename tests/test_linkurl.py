"""Link URLs: every example, addresses, and what is none, each with a text that says what to write."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.errors import ConfigError
from bench.rigfile import linkurl


@pytest.mark.parametrize("scheme", linkurl.EXAMPLES)
def test_every_example_is_a_url_of_its_scheme(scheme: str) -> None:
    assert linkurl.parse(linkurl.EXAMPLES[scheme]).scheme == scheme


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("inprocess:", ("inprocess", "", {})),
        ("slcan:COM3", ("slcan", "COM3", {})),
        ("slcan:socket://127.0.0.1:28501", ("slcan", "socket://127.0.0.1:28501", {})),
        ("can:socketcan:can0?bitrate=500000&fd=true", ("can", "socketcan:can0", {"bitrate": "500000", "fd": "true"})),
        ("serial:rfc2217://box:7000?baudrate=9600", ("serial", "rfc2217://box:7000", {"baudrate": "9600"})),
        ("serial:/dev/tty%20?x=%2F&y=", ("serial", "/dev/tty%20", {"x": "/", "y": ""})),
    ],
)
def test_a_url_is_taken_apart(url: str, expected: tuple[str, str, dict[str, str]]) -> None:
    parsed = linkurl.parse(url)
    assert (parsed.scheme, parsed.rest, parsed.query) == expected


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("slcna:/dev/ttyACM0", "did you mean 'slcan:/dev/ttyACM0'"),
        ("modbustcp:1.2.3.4:502", "did you mean 'modbus-tcp:192.168.0.20:502'"),
        ("/dev/ttyACM0", "expected one of inprocess, slcan, can, serial"),
        ("", "expected one of"),
        ("slcan:", "found no address"),
        ("slcan:?bitrate=5", "found no address"),
    ],
)
def test_what_is_no_url_is_refused_with_what_to_write(url: str, says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        linkurl.parse(url)


@pytest.mark.parametrize(
    ("rest", "address"),
    [("localhost:502", ("localhost", 502)), ("0.0.0.0:0", ("0.0.0.0", 0)), ("[::1]:65535", ("::1", 65535))],
)
def test_an_address(rest: str, address: tuple[str, int]) -> None:
    assert linkurl.parse(f"modbus-tcp:{rest}").address == address


@pytest.mark.parametrize(
    "rest", ["localhost", ":502", "localhost:", "h:65536", "h:-1", "h:²", "h:5x", "[]:5", f"h:{'9' * 5000}"]
)
def test_what_is_no_address_is_refused(rest: str) -> None:
    with pytest.raises(ConfigError, match="expected HOST:PORT"):
        _ = linkurl.parse(f"line:{rest}").address


@given(st.one_of(st.text(), st.builds("{}:{}".format, st.sampled_from(sorted(linkurl.EXAMPLES)), st.text())))
def test_any_text_is_a_url_or_refused(text: str) -> None:
    try:
        parsed = linkurl.parse(text)
    except ConfigError:
        return
    assert text.startswith(f"{parsed.scheme}:{parsed.rest}")
    try:
        host, port = parsed.address
    except ConfigError:
        return
    assert host
    assert 0 <= port <= 65535
