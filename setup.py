"""What pyproject.toml cannot say of a build: data that lie beside the packages in a clone and inside one where installed, and
the C core, which a wheel brings compiled.

Such a wheel is one for all Pythons of its platform: the core is loaded through cffi's ABI mode and knows nothing of Python.
Where there is no compiler the wheel is for any platform, and the core is built when it is first used.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

from setuptools import find_namespace_packages, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
PACKAGES = ("bench", "drivers", "procedures", "reports", "sim_backend")
DATA = ("rigs", "specs", "campaigns")
CORE = "sim_backend/core"


class BuildWithCore(build_py):
    """The packages, and the C core beside its sources."""

    compiled = False

    def run(self) -> None:
        super().run()
        if self.editable_mode:  # a clone builds its core when that is first used
            return
        sys.path.insert(0, str(ROOT))
        try:
            built = _build_module()
            try:
                built.compile_all(Path(self.build_lib) / CORE)
            except built.ConfigError as error:
                self.warn(f"the C core is left out, and is built when it is first used: {error}")
            else:
                self.compiled = True
        finally:
            sys.path.remove(str(ROOT))


class PlatformWheel(bdist_wheel):
    """A wheel for every Python of this platform, or of any platform where nothing was compiled."""

    def run(self) -> None:
        self.run_command("build_py")  # before it is named: the name says whether there is a core in it
        super().run()

    def get_tag(self) -> tuple[str, str, str]:
        self.root_is_pure = not self.get_finalized_command("build_py").compiled
        return "py3", "none", "any" if self.root_is_pure else super().get_tag()[2]


def _build_module() -> Any:
    """`sim_backend/core/build.py` by its path: its package would ask for numpy, which builds nothing here."""
    spec = importlib.util.spec_from_file_location("core_build", ROOT / CORE / "build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


setup(
    packages=[
        *find_namespace_packages(str(ROOT), include=[name for p in PACKAGES for name in (p, f"{p}.*")]),
        *(f"bench.data.{kind}" for kind in DATA),
    ],
    package_dir={f"bench.data.{kind}": kind for kind in DATA},
    cmdclass={"build_py": BuildWithCore, "bdist_wheel": PlatformWheel},
)
