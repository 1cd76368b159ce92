"""The files of the page: a fixed table, read once. Nothing that a request says becomes a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources

TYPES: Mapping[str, str] = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
}


@dataclass(frozen=True)
class Asset:
    content_type: str
    content: bytes


def page_assets(first: str = "index.html") -> dict[str, Asset]:
    """By path: all files of the page whose type is known; `/` is `first`, the one page among them."""
    found: dict[str, Asset] = {}
    for file in resources.files("bench.live").joinpath("page").iterdir():
        suffix = "." + file.name.rpartition(".")[2]
        if suffix in TYPES and file.is_file() and (suffix != ".html" or file.name == first):
            found[f"/{file.name}"] = Asset(TYPES[suffix], file.read_bytes())
    if f"/{first}" in found:
        found["/"] = found[f"/{first}"]
    return found
