"""Whether a wheel holds what it must and nothing else: `python install/check_wheel.py WHEEL`, from the clone that it is of.

Every file of the packages, the data inside one of them, the C core compiled for every kind of processor of its platform, and
a name that says so. Exit status 1 where something is wrong, a line each.
"""

from __future__ import annotations

import platform
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("bench", "drivers", "procedures", "reports", "sim_backend")
DATA = ("rigs", "specs", "campaigns")
NOT_SHIPPED = (".pyc", ".so")
CORE = "sim_backend/core/"


def expected(root: Path = ROOT) -> dict[str, str]:
    """What a wheel holds of a clone: each file's place in it, by its place in the clone."""
    found = [path for room in (*PACKAGES, *DATA) for path in (root / room).rglob("*") if path.is_file()]
    names = [path.relative_to(root).as_posix() for path in found]
    own = {n: n for n in names if not n.endswith(NOT_SHIPPED) and ".calibrations/" not in n}
    return {"levbench.py": "levbench.py"} | {
        n: f"bench/data/{n}" if n.split("/")[0] in DATA else n for n in own.values()
    }


def problems(wheel: Path) -> Iterator[str]:
    """What is wrong with a wheel, in words."""
    with zipfile.ZipFile(wheel) as file:
        names = {name for name in file.namelist() if not name.endswith("/")}
        if broken := file.testzip():
            yield f"{broken}: is broken"
    information = "-".join(wheel.name.split("-")[:2]) + ".dist-info"
    cores = {name for name in names if name.startswith(CORE) and name.endswith(".so")}
    for missing in sorted(set(expected().values()) - names):
        yield f"{missing}: is not in it; expected every file of the packages and of the data"
    for more in sorted(names - set(expected().values()) - cores):
        if more.split("/")[0] != information:
            yield f"{more}: is in it; expected nothing but packages, data and {information}"
    kinds = ["core", "core_avx2"] if platform.machine() in ("x86_64", "AMD64") else ["core"]
    if (found := sorted(name.removeprefix(CORE).split("-")[0] for name in cores)) != kinds:
        yield f"{CORE}: found {found or 'no compiled core'}; expected {kinds}"
    python, abi, tag = wheel.stem.split("-")[-3:]
    if (python, abi) != ("py3", "none") or tag == "any":
        yield f"{wheel.name}: expected py3-none-PLATFORM: for every Python, of one platform"


def main(arguments: list[str]) -> int:
    wrong = [f"{path}: {problem}" for path in arguments for problem in problems(Path(path))]
    sys.stdout.write("\n".join(wrong or [f"{path}: holds what it must" for path in arguments]) + "\n")
    return int(bool(wrong) or not arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
