"""Who may ask: pure checks of a request's head. Each refusal has a status and says what is wrong and what to do next.

Host against DNS rebinding, Origin against other pages, the token against everybody else, a header of our own against forms
that another page sends (CVE-2025-49596 and CVE-2025-52882 are what happens without).
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

TOKEN_HEADER = "X-Levbench-Token"
TOKEN_BYTES = 16  # 128 bit
BODY_BYTES = 4096
NEXT = "Next: open the address that bench printed, with all that follows its #"


class Headers(Protocol):
    """As the standard library parses them; names in any case."""

    def get_all(self, name: str, /) -> Sequence[str] | None: ...


@dataclass(frozen=True)
class Refused(Exception):
    """A request that is not answered: its status and a sentence."""

    status: int
    text: str


def new_token() -> str:
    """128 random bits, url-safe."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def check_host(headers: Headers, local: str, port: int, named: str = "") -> str:
    """The one Host header, which must be this server's own address.

    Args:
        local: the address at which the connection came in.
        named: the name by which the server was bound, if any.

    Raises:
        Refused: 403, another, several or none.
    """
    found = headers.get_all("Host") or []
    known = {f"{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]", _bracketed(local), named.lower()) if name}
    if port == 80:
        known |= {host.removesuffix(":80") for host in known}
    if len(found) != 1 or found[0].strip().lower() not in known:
        raise Refused(403, f"Host: found {', '.join(found)[:80] or 'none'}; expected this server's own address. {NEXT}")
    return found[0].strip()


def _bracketed(address: str) -> str:
    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return ""
    plain = found.ipv4_mapped if isinstance(found, ipaddress.IPv6Address) else found
    return f"[{found}]" if plain is None else str(plain)


def check_origin(headers: Headers, host: str) -> None:
    """Where a browser says which page asks, it must be ours.

    Raises:
        Refused: 403.
    """
    found = headers.get_all("Origin") or []
    if any(origin.strip().lower() != f"http://{host.lower()}" for origin in found) or len(found) > 1:
        raise Refused(403, "Origin: the request comes from another page; expected this server's own")


def check_token(headers: Headers, token: str) -> None:
    """The token in the header of our own.

    Raises:
        Refused: 403, another, several or none.
    """
    found = headers.get_all(TOKEN_HEADER) or []
    if len(found) != 1 or not same(found[0], token):
        raise Refused(403, f"{TOKEN_HEADER}: found {'another' if found else 'none'}; expected the run's token. {NEXT}")


def same(found: str, secret: str) -> bool:
    """Whether two texts are equal, in a time that tells nothing of where they differ."""
    return hmac.compare_digest(found.encode("utf-8", "replace"), secret.encode())


def cookie_of(headers: Headers, name: str) -> str:
    """The value of a cookie, "" without it."""
    pairs = (pair.strip().partition("=") for line in headers.get_all("Cookie") or [] for pair in line.split(";"))
    return next((value for key, _, value in pairs if key == name), "")


def body_length(headers: Headers) -> int:
    """How long the body of a request in JSON is.

    Raises:
        Refused: 415, another type; 411, no length; 413, too long.
    """
    kinds = headers.get_all("Content-Type") or []
    if len(kinds) != 1 or kinds[0].partition(";")[0].strip().lower() != "application/json":
        raise Refused(415, "Content-Type: expected application/json")
    lengths = headers.get_all("Content-Length") or []
    if len(lengths) != 1 or headers.get_all("Transfer-Encoding") or not (lengths[0].isascii() and lengths[0].isdigit()):
        raise Refused(411, "Content-Length: expected one, and no Transfer-Encoding")
    if len(lengths[0]) > 9 or int(lengths[0]) > BODY_BYTES:
        raise Refused(413, f"body: expected at most {BODY_BYTES} bytes")
    return int(lengths[0])


SECURE: Mapping[str, str] = {
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}
"""Headers of every answer."""
PAGE_POLICY = "default-src 'self'; base-uri 'none'; form-action 'none'; object-src 'none'; frame-ancestors 'none'"
REPORT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'self'; sandbox"
)
"""A report is a document of its own, without scripts: it brings its styles and figures with it."""
