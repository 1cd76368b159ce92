"""What installed packages add to the bench, by entry points of theirs: procedures, machines, devices and links.

    [project.entry-points."levbench.procedures"]
    hover-constant = "levbench_ball.hover:procedure"

Their metadata are read when something is asked for by name or listed, once; of a package nothing is imported before what it
registers is used. A name has one owner: two are an error that names both, for that name alone.
"""

from __future__ import annotations

import importlib
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from bench.errors import BenchError, ConfigError

if TYPE_CHECKING:
    from importlib.metadata import Distribution

PREFIX = "levbench."
PROCEDURES, MACHINES, DEVICES, LINKS = (f"{PREFIX}{kind}" for kind in ("procedures", "machines", "devices", "links"))
GROUPS = (PROCEDURES, MACHINES, DEVICES, LINKS)
OURS = "levbench"
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Point:
    """What a package registers: `value` is module:attribute, `package` the distribution's name and `version` its version."""

    group: str
    name: str
    value: str
    package: str
    version: str

    @property
    def kind(self) -> str:
        """`procedure`, `machine`, `device` or `link`."""
        return self.group.removeprefix(PREFIX).removesuffix("s")

    @property
    def module(self) -> str:
        """The module that holds it."""
        return self.value.partition(":")[0].strip()

    @property
    def owner(self) -> str:
        """Who registers it, for people: distribution, version and module."""
        return f"{self.package} {self.version} ({self.value})"


def points(group: str) -> tuple[Point, ...]:
    """All that installed packages register in a group, also what is taken twice."""
    return tuple(p for p in _read(tuple(sys.path))[0] if p.group == group)


def problems() -> tuple[str, ...]:
    """What is wrong with the metadata of packages that register something, a sentence each."""
    return _read(tuple(sys.path))[1]


def found(group: str, name: str, ours: str = "") -> Point | None:
    """What a package registers under a name; None where none does. `ours` is what holds that name in Levbench itself.

    Raises:
        ConfigError: it is taken twice.
    """
    named = [p for p in points(group) if p.name == name]
    if named and (ours or len(named) > 1):
        raise ConfigError(taken_twice(named, ours))
    return named[0] if named else None


def names(group: str, ours: Mapping[str, str]) -> tuple[str, ...]:
    """The names that packages add to ours, without those that are taken twice."""
    listed = [p.name for p in points(group)]
    return tuple(n for n in listed if n not in ours and listed.count(n) == 1)


def clashes(group: str, ours: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Each name of a group that is taken twice, and a sentence that says by whom. `ours` are Levbench's own, with what holds
    them."""
    for name in dict.fromkeys(p.name for p in points(group)):
        named = [p for p in points(group) if p.name == name]
        if len(named) > 1 or name in ours:
            yield name, taken_twice(named, ours.get(name, ""))


def taken_twice(named: list[Point], ours: str = "") -> str:
    """The sentence that names every owner of a name."""
    owners = [*([f"{OURS} ({ours})"] if ours else []), *(p.owner for p in named)]
    first, *_ = named
    return (f"{first.kind} {first.name!r} is taken twice: found {' and '.join(owners)}; expected one owner of a name. "
            f"Next: uninstall one of them, or rename it in the entry points of {named[-1].package}")  # fmt: skip


def load(point: Point, kind: type[T]) -> T:
    """What a package registers, imported.

    Raises:
        ConfigError: it cannot be imported, or is of another kind.
    """
    attributes = [a for a in point.value.partition(":")[2].split(".") if a]
    try:
        loaded = reduce(getattr, attributes, importlib.import_module(point.module))
    except (Exception, SystemExit) as error:
        raise ConfigError(f"{point.kind} {point.name!r} of {point.owner} cannot be loaded: {said(error)}. {_next(point)}"
                          ) from error  # fmt: skip
    if not isinstance(loaded, kind):
        what = f"found a {type(loaded).__name__}; expected a {kind.__module__}.{kind.__name__}"
        raise ConfigError(f"{point.kind} {point.name!r} of {point.owner}: {what}. {_next(point)}")
    return loaded


def said(error: BaseException) -> str:
    """An exception of somebody else's code in one line: its kind, where in that code it came up, and what it says."""
    inside = ("<", importlib.__path__[0], str(Path(__file__).parent))
    frames = (f for f in traceback.extract_tb(error.__traceback__) if not f.filename.startswith(inside))
    first = next(frames, None)
    place = "" if first is None else f" in {Path(first.filename).name}:{first.lineno}"
    text = " ".join(str(error).split())
    return f"{type(error).__name__}{place}{': ' if text else ''}{text}"


def guarded(call: Callable[..., Any], whose: str, whole: Callable[[Any], Any] | None = None) -> Callable[..., Any]:
    """A function of somebody else's, of which every exception but our own is a ConfigError that says whose it is; `whole` makes
    what it gives complete, where that comes piece by piece."""

    def called(*arguments: Any) -> Any:
        try:
            given = call(*arguments)
            return given if whole is None else whole(given)
        except BenchError:
            raise
        except Exception as error:
            raise ConfigError(f"{whose}: {said(error)}; nothing was started") from error

    return called


def _next(point: Point) -> str:
    return f"Next: tell who wrote the package, or `pip uninstall {point.package}`"


@cache
def _read(_: tuple[str, ...]) -> tuple[tuple[Point, ...], tuple[str, ...]]:
    """Everything that is registered on a `sys.path`, and what of it cannot be read. Of a distribution that lies there twice
    the first counts, as for imports."""
    from importlib.metadata import distributions

    read: dict[str, tuple[Point, ...]] = {}
    wrong: list[str] = []
    for distribution in distributions():
        text = distribution.read_text("entry_points.txt") or ""
        if PREFIX not in text:
            continue
        try:
            package, registered = _registered(distribution)
            read.setdefault(package.lower().replace("_", "-"), registered)
        except Exception as error:
            where = getattr(distribution, "_path", "a package")
            wrong.append(f"entry points of {where} cannot be read: {said(error)}; expected lines such as "
                         "`name = module:attribute`. Next: install that package anew")  # fmt: skip
    return tuple(point for several in read.values() for point in several), tuple(wrong)


def _registered(distribution: Distribution) -> tuple[str, tuple[Point, ...]]:
    package, version = distribution.metadata["Name"] or "a package without a name", distribution.version
    listed = (
        Point(e.group, e.name, e.value, package, version)
        for e in distribution.entry_points
        if e.group.startswith(PREFIX)
    )
    return package, tuple(dict.fromkeys(listed))
