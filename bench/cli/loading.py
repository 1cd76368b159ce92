"""From a procedure's name, or its file, to the procedure, without what opens rigs.

A procedure of a package or of a file is somebody else's code: what goes wrong in it before a machine is touched is a message
that says whose it is. A file is executed where its name is typed, and nowhere else: no recording and no rig file makes the
bench execute one.
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import importlib.util
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

from bench import catalogue, extensions
from bench.errors import ConfigError
from bench.procedure import BenchPlan, Origin, Procedure, Quantity
from bench.procedure.origin import FILE
from bench.procedure.requires import Requires
from bench.procedure.roles import RigState
from bench.rigfile import RigFile
from bench.rundir import LISTENED

NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
HOLDS = re.compile(r"^procedure\b[^=\n]*=(?!=)", re.MULTILINE)
NEXT = "Next: docs/how-to/add-a-procedure.md has one to begin from"


@dataclass(frozen=True)
class _Loaded:
    """A procedure's file that this process has executed."""

    path: Path
    procedure: Procedure


_files: dict[str, _Loaded] = {}


def load_procedure(name: str) -> Procedure:
    """The procedure of that name in the catalogue, or in the file of that name (`./my_procedure.py`).

    Raises:
        ConfigError: there is none, it cannot be used, its name is taken twice, or it is no procedure that a recording names.
    """
    if name == LISTENED:
        raise ConfigError(
            "it was recorded by `bench listen`, which measures nothing. Next: `bench export` writes what came"
        )
    if is_file(name):
        return load_file(Path(name))
    return executed(name) or of_entry(_entry(name))


def _entry(name: str) -> catalogue.Entry:
    try:
        return catalogue.entry(name)
    except ConfigError as error:
        path = Path(f"{name}.py")
        if not path.is_file():
            raise
        raise ConfigError(f"{path} is a file: give it with its ending, ./{path}. {error}") from error


def of_entry(entry: catalogue.Entry) -> Procedure:
    """The procedure of a line of the catalogue.

    Raises:
        ConfigError: it is a package's, and cannot be used.
    """
    if entry.point is None:
        found: Procedure = importlib.import_module(entry.module).procedure
        return found
    loaded = extensions.load(entry.point, Procedure)
    whose = f"procedure {entry.name!r} of {entry.owner}"
    if loaded.name != entry.name:
        raise ConfigError(f"{whose}: found the name {loaded.name!r} in it; expected that of its entry point. "
                          f"Next: tell who wrote the package")  # fmt: skip
    return _foreign(loaded, whose, Origin(entry.point.package, entry.point.version))


def requires_of(entry: catalogue.Entry) -> Callable[[RigFile], Requires]:
    """What a procedure of ours needs of a rig: by its room's `requires.py`, where it has one, without the procedure, which
    takes longer to import."""
    room = entry.module.rpartition(".")[0]
    if not room or importlib.util.find_spec(f"{room}.requires") is None:
        return of_entry(entry).requires
    found: Callable[[RigFile], Requires] = importlib.import_module(f"{room}.requires").requires
    return found


def loadable() -> Iterator[Procedure]:
    """The procedures of the catalogue, without those of packages that cannot be used."""
    for entry in catalogue.procedures():
        try:
            yield of_entry(entry)
        except ConfigError:
            continue


def executed(name: str) -> Procedure | None:
    """The procedure of that name of a file that this process was told to execute."""
    return _files[name].procedure if name in _files else None


def known() -> Iterator[Procedure]:
    """Those that can be loaded, and those of files that a command named."""
    yield from loadable()
    yield from (f.procedure for f in _files.values())


def is_file(name: str) -> bool:
    """Whether what was given for a procedure is meant as a file."""
    return name.endswith(".py") or "/" in name or os.sep in name


def holds_procedure(path: Path) -> bool:
    """Whether a file of Python looks like one that holds a procedure; it is read, not executed."""
    try:
        return bool(HOLDS.search(path.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return False


def beside(rig: RigFile) -> list[tuple[Path, str]]:
    """The files beside a rig file that look like ones of procedures, each with the name that its text states, "" where it
    states none. They are read, not executed."""
    files = sorted(Path(rig.path).parent.glob("*.py"))
    return [(path, _stated_name(path)) for path in files if holds_procedure(path)]


def _stated_name(path: Path) -> str:
    try:
        body = ast.parse(path.read_text(encoding="utf-8")).body
    except (SyntaxError, ValueError, RecursionError):
        return ""
    calls = [node.value for node in body if isinstance(node, ast.Assign | ast.AnnAssign)]
    words = [w for call in calls if isinstance(call, ast.Call) for w in call.keywords if w.arg == "name"]
    names = [w.value.value for w in words if isinstance(w.value, ast.Constant) and isinstance(w.value.value, str)]
    return names[-1] if names else ""


def load_file(path: Path) -> Procedure:
    """The procedure that a file holds as `procedure`; the file is executed, once for each text of it.

    Raises:
        ConfigError: it cannot be read or executed, holds no procedure, or one whose name is taken.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        what = f"{error.strerror or error}; expected a Python file that holds a procedure"
        raise ConfigError(f"procedure file {path}: {what}. Next: `bench list` shows those with a name") from error
    if (listed := catalogue.of_file(path)) is not None:
        return of_entry(listed)
    origin = Origin(path.name, FILE + hashlib.sha256(data).hexdigest(), path=str(path.resolve()))
    for known in _files.values():
        if known.path == path.resolve() and known.procedure.origin == replace(origin, text=_text(data)):
            return known.procedure
    module = _executed(path, data)
    if not isinstance(found := getattr(module, "procedure", None), Procedure):
        what = "no `procedure`" if found is None else f"procedure = a {type(found).__name__}"
        raise ConfigError(
            f"procedure file {path}: found {what}; expected `procedure = Procedure(...)` of bench.procedure. {NEXT}"
        )
    procedure = _foreign(found, f"procedure file {path}", replace(origin, text=_text(data)))
    _refuse_taken(procedure.name, path)
    _files[procedure.name] = _Loaded(path.resolve(), procedure)
    return procedure


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


def _executed(path: Path, data: bytes) -> ModuleType:
    """A module of the file's text as it was read. Modules beside it are found after all others."""
    module = ModuleType(f"procedure_file_{path.stem}_{hashlib.sha256(data).hexdigest()[:8]}")
    module.__file__ = str(path.resolve())
    sys.modules[module.__name__] = module  # dataclasses and plans look their module up
    if (folder := str(path.resolve().parent)) not in sys.path:
        sys.path.append(folder)
    try:
        exec(compile(data, str(path), "exec", dont_inherit=True), vars(module))
    except (Exception, SystemExit) as error:
        del sys.modules[module.__name__]
        raise ConfigError(f"procedure file {path}: cannot be executed: {extensions.said(error)}. {NEXT}") from error
    return module


def _refuse_taken(name: str, path: Path) -> None:
    owners = [e.owner for e in catalogue.procedures() if e.name == name]
    owners += [why for taken, why in catalogue.taken_twice() if taken == name]
    owners += [f"the file {f.path}" for n, f in _files.items() if n == name and f.path != path.resolve()]
    if owners:
        raise ConfigError(f"procedure {name!r} is taken twice: found {owners[0]} and the file {path}; expected one owner of a "
                          "name. Next: give the one in the file another name")  # fmt: skip


def _foreign(found: Procedure, whose: str, origin: Origin) -> Procedure:
    """Somebody else's procedure, looked at and guarded: what its functions raise before the start is an error that says whose.

    Raises:
        ConfigError: something in it is not what it should be.
    """
    if wrong := list(_wrong(found)):
        raise ConfigError("\n  ".join([f"{whose}: it cannot be used:", *wrong]))

    whole = {"requires": None, "check": tuple, "settings": dict, "needs": tuple, "foresees": tuple, "holds_for": dict,
             "step_count": None}  # fmt: skip
    calls: dict[str, Any] = {name: extensions.guarded(getattr(found, name), whose, of) for name, of in whole.items()}
    return replace(found, origin=origin, **calls)


def _wrong_defaults(plan: type[BenchPlan]) -> Iterator[str]:
    """Settings without a default, or with one that the plan itself would refuse."""
    from pydantic import ValidationError

    try:
        plan.model_validate(dict(plan()))
    except ValidationError as error:
        for e in error.errors(include_url=False):
            yield f"plan.{'.'.join(map(str, e['loc']))}: found {e['input']!r} as its default; expected another: {e['msg']}"


def _wrong(p: Procedure) -> Iterator[str]:
    """What is not of its kind in a procedure."""
    if not isinstance(p.name, str) or not NAME.fullmatch(p.name) or p.name == LISTENED:
        yield f"name: found {p.name!r}; expected words of a-z and 0-9 with hyphens between"
    if not (isinstance(p.measures, tuple) and all(isinstance(q, Quantity) for q in p.measures)):
        yield f"measures: found {p.measures!r}; expected a tuple of Quantity"
    if not isinstance(p.state, RigState):
        yield f"state: found {p.state!r}; expected a RigState"
    if not (isinstance(p.plan, type) and issubclass(p.plan, BenchPlan)):
        yield f"plan: found {p.plan!r}; expected a class that is a BenchPlan"
    else:
        yield from _wrong_defaults(p.plan)
    calls: Mapping[str, Any] = {n: getattr(p, n) for n in ("acquire", "evaluate", "measured", "figures", "check",
                                                           "requires", "settings", "needs")}  # fmt: skip
    yield from (f"{name}: found {call!r}; expected a function" for name, call in calls.items() if not callable(call))
