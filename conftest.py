"""In a clone: `pytest procedures --rig RIG` without an installation, and the fixture `inject`.

What does it is `bench.cli.pytest_plugin`, which is there already where Levbench is installed: then it is not registered again.
"""

from __future__ import annotations

import pytest

from bench.cli import pytest_plugin
from bench.cli.injection import inject  # noqa: F401 (a fixture)


def pytest_addoption(parser: pytest.Parser, pluginmanager: pytest.PytestPluginManager) -> None:
    if not pluginmanager.has_plugin(pytest_plugin.NAME):
        pluginmanager.register(pytest_plugin, pytest_plugin.NAME)
    config = pluginmanager.get_plugin("pytestconfig")
    assert isinstance(config, pytest.Config)
    pytest_plugin.add_options(config, parser)
