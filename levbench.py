"""The command `bench` from its first line on: whether the packages that it is made of are Levbench's is seen before one of them
is imported. The standard library alone, since nothing else can be trusted to be there.

Other distributions have packages called `bench`, `drivers` or `reports`. Installed into one environment, one overwrites the
other's files; beside each other on the path, one hides the other. Neither is told by pip.
"""

from __future__ import annotations

import importlib.util
import os
import re
import sys
from collections.abc import Iterator

HERE = os.path.dirname(os.path.abspath(__file__))
PACKAGES = ("bench", "drivers", "procedures", "reports", "sim_backend")
FILE_IN_ONE = re.compile(rb"\n(%s)/" % "|".join(PACKAGES).encode())
OURS = "levbench-"
USAGE = 2


def main() -> int:
    """Run one command; returns its exit status, 2 where a package of ours is another distribution's."""
    if problems := list(foreign_packages()):
        found = "\n  ".join(problems)
        sys.stderr.write(
            f"bench: packages of Levbench belong to another distribution too:\n  {found}\nexpected an environment of its own. "
            "Next: python -m venv levbench, and install the wheel there with levbench/bin/pip (docs/how-to/install.md)\n"
        )
        return USAGE
    from bench.cli.start import main as run

    return run()


def foreign_packages() -> Iterator[str]:
    """Each package of ours that another distribution owns or hides: which, whose, where."""
    homes = {name: _home(name) for name in PACKAGES}
    home = homes["bench"]
    root = home if os.path.isfile(os.path.join(home, "bench", "cli", "start.py")) else HERE
    for name in (name for name in PACKAGES if homes[name] != root):
        owner = next((owner for owner, package in _owners(homes[name]) if package == name), "an unnamed distribution")
        yield f"package `{name}`: found that of {owner} in {homes[name] or 'no folder'}; expected the one in {root}"
    for owner, name in _owners(root):
        yield f"package `{name}`: found files of {owner} among ours in {root}"


def _home(package: str) -> str:
    """The folder that a package would be imported from; empty where there is none."""
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError):
        return ""
    where = list(spec.submodule_search_locations or ()) if spec else []
    return os.path.dirname(where[0]) if where else ""


def _owners(folder: str) -> Iterator[tuple[str, str]]:
    """Distributions in a folder, but for Levbench, that own a package called as one of ours: name and version, package.

    Their lists of files are searched as bytes: to read them as `importlib.metadata` does takes a hundred times as long.
    """
    try:
        entries = os.listdir(folder)
    except OSError:
        return
    for entry in sorted(entries):
        stem, ending = os.path.splitext(entry)
        if ending not in (".dist-info", ".egg-info") or stem.lower().startswith(OURS) or stem.lower() == OURS[:-1]:
            continue
        files = _listed(os.path.join(folder, entry))
        for package in sorted(set(FILE_IN_ONE.findall(b"\n" + files))):
            yield " ".join(stem.split("-")[:2]), package.decode()


def _listed(information: str) -> bytes:
    """The list of a distribution's files; of an old one, its packages in the same form."""
    for name in ("RECORD", "top_level.txt"):
        try:
            with open(os.path.join(information, name), "rb") as file:
                content = file.read()
        except OSError:
            continue
        return content if name == "RECORD" else content.replace(b"\n", b"/\n")
    return b""


if __name__ == "__main__":
    sys.exit(main())
