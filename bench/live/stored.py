"""Runs that are over, on the same server: what is asked of a folder of them, and how it is answered. Nothing is changed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar
from urllib.parse import parse_qs, unquote

from bench.errors import BenchError, ConfigError
from bench.live import gate
from bench.live.assets import page_assets
from bench.live.exchange import Exchange
from bench.live.gate import Refused
from bench.live.site import Served

RUN, REPORT = "/run/", "/report.html"
FIELDS, CHARACTERS = 8, 200  # of a query at most, and in each

Query = Mapping[str, str]
T = TypeVar("T")


class Stored(Protocol):
    """A folder of runs. Each may raise Refused, ConfigError for what is asked for wrongly, or BenchError."""

    def runs(self, asked: Query) -> Mapping[str, Any]: ...
    def run(self, run_id: str) -> Mapping[str, Any]: ...
    def report(self, run_id: str) -> bytes: ...
    def trend(self, asked: Query) -> Mapping[str, Any]: ...
    def figure(self, asked: Query) -> str: ...


@dataclass
class StoredSite(Served):
    """The page of a folder of runs."""

    stored: Stored


def stored_site(stored: Stored, named: str = "") -> StoredSite:
    """The page of a folder, with a token of its own."""
    return StoredSite(stored, named=named, assets=page_assets("show.html"))


class StoredHandler(Exchange):
    """GET alone: the page's files to anybody who speaks to this server, all else by the token; report and figure also by the
    cookie that comes with the first answer."""

    def __init__(self, site: StoredSite, *of_the_server: Any) -> None:
        self.stored = site.stored
        super().__init__(site, *of_the_server)

    def do_GET(self) -> None:
        self._guarded(self._found)

    def _found(self) -> None:
        path, _, query = self.path.partition("?")
        if path in self.served.assets:
            return self._asset(path)
        if path == "/runs":
            return self._data(lambda: self.stored.runs(_fields(query)))
        if path == "/trend":
            return self._data(lambda: self.stored.trend(_fields(query)))
        if path == "/trend.svg":
            self._known()
            svg = _answered(lambda: self.stored.figure(_fields(query)))
            return self._document("image/svg+xml", svg.encode())
        if path.startswith(RUN) and path.endswith(REPORT):
            self._known()
            run_id = unquote(path.removeprefix(RUN).removesuffix(REPORT))
            return self._document("text/html; charset=utf-8", _answered(lambda: self.stored.report(run_id)))
        if path.startswith(RUN):
            return self._data(lambda: self.stored.run(unquote(path.removeprefix(RUN))))
        raise Refused(404, "no such page")

    def _data(self, ask: Callable[[], Mapping[str, Any]]) -> None:
        gate.check_token(self.headers, self.served.token)
        self._json(200, _answered(ask), {"Set-Cookie": self._cookie("/")})


def _answered(ask: Callable[[], T]) -> T:
    """What the folder answers.

    Raises:
        Refused: 400, asked for wrongly; 500, the folder cannot be read.
    """
    try:
        return ask()
    except ConfigError as error:
        raise Refused(400, str(error)) from error
    except BenchError as error:
        raise Refused(500, str(error)) from error


def _fields(query: str) -> dict[str, str]:
    """The fields of a query, each once; an empty one is as none.

    Raises:
        Refused: 400, too many, too long or twice.
    """
    try:
        found = parse_qs(query, max_num_fields=FIELDS)
    except ValueError as error:
        raise Refused(400, f"query: expected at most {FIELDS} fields") from error
    if any(len(values) > 1 or len(values[0]) > CHARACTERS for values in found.values()):
        raise Refused(400, f"query: expected each field once, of at most {CHARACTERS} characters")
    return {name: values[0] for name, values in found.items()}
