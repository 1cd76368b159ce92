"""Packages as an installation leaves them: a folder on `sys.path` with modules and the metadata of a distribution."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

SMALL = '''
"""A look at the supply, from outside."""
from collections.abc import Iterator

from bench.procedure import BenchPlan, Measured, Procedure, Quantity
from bench.procedure.roles import RigState
from bench.uncertainty import Estimate, Influence

SUPPLY = Quantity("supply", "V", "mean supply voltage")


class Plan(BenchPlan):
    """Settings."""

    seconds: float = 0.3


def acquire(rig, plan, record) -> None:
    """One step."""
    with record.step("look"):
        rig.clock.sleep(plan.seconds)


def measured(recording) -> Iterator[Measured]:
    """The mean of it."""
    value = next(iter(recording.steps("look"))).mean("supply")
    one = Influence(id="supply/gain", name="gain", u=1e-3, unit="V", kind="B", distribution="normal")
    yield SUPPLY.measured(Estimate.of(value, one))


procedure = Procedure(
    name="NAME", title="A look", measures=(SUPPLY,), state=RigState.LEVITATED, plan=Plan, acquire=acquire, measured=measured,
    step_count=lambda plan: 1,
)
'''
"""A procedure in one file, without `evaluate`."""


def small(name: str) -> str:
    """Its text, by another name."""
    return SMALL.replace("NAME", name)


def install(
    folder: Path,
    package: str,
    points: Mapping[str, Mapping[str, str]],
    modules: Mapping[str, str],
    version: str = "1.2",
) -> None:
    """Put a distribution into a folder: its entry points by group, its modules by name."""
    info = folder / f"{package.replace('-', '_')}-{version}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: {version}\n")
    groups = (f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in named.items()) for group, named in points.items())
    (info / "entry_points.txt").write_text("\n".join(groups))
    for name, text in modules.items():
        (folder / f"{name}.py").write_text(text)
