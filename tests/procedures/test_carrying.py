"""Can the bearings lift the shaft: the force that an axis must give against what its coil can, by hand."""

from __future__ import annotations

import math

import pytest

from bench.rigfile import RigFile, load_rig
from procedures.amb_rotor import carrying
from procedures.amb_rotor.conventions import conventions


def with_defaults(rig: RigFile, **values: float) -> RigFile:
    changed = {name: rig.parameters[name].model_copy(update={"default": v}) for name, v in values.items()}
    return rig.model_copy(update={"parameters": {**rig.parameters, **changed}})


def test_every_axis_carries_its_share_of_the_weight() -> None:
    rig = load_rig("amb5dof")
    loads = {x.axis: x for x in carrying.loads(rig)}
    machine = conventions(rig)
    near, far = (machine.stations.axes[a].arm.value for a in ("yi", "yo"))
    assert rig.shaft is None or rig.shaft.mass is not None
    weight = carrying.mass(rig) * rig.site.gravity.value
    assert loads["yi"].needed == pytest.approx(weight * far / (far - near) / math.sqrt(2), rel=1e-6)
    assert loads["yo"].needed == pytest.approx(weight * -near / (far - near) / math.sqrt(2), rel=1e-6)


def test_what_a_coil_gives_across_the_ring() -> None:
    rig = load_rig("amb5dof")
    machine, (load, *_) = conventions(rig), carrying.loads(rig)
    bias = machine.biases[load.axis]
    rig = with_defaults(rig, **{bias: 0.5, machine.model_beta(load.axis): 7e-7})
    found = next(x for x in carrying.loads(rig) if x.axis == load.axis)
    assert found.current == 1.0
    offset = rig.parameters[machine.model_offset(load.axis)].default
    low = machine.clearance / math.sqrt(2) - offset  # of each axis, 45 degrees from upright
    assert found.available == pytest.approx(
        7e-7 * 1.0 / (machine.gaps[load.axis] + low) ** 2, rel=0.03
    )  # the rings stand at the probes


def test_a_bias_that_cannot_carry_is_named_with_both_forces() -> None:
    rig = load_rig("amb5dof")
    assert "each axis can carry its share" in carrying.told(rig)
    bias = conventions(rig).biases["yi"]
    told = carrying.told(with_defaults(rig, **{bias: 0.1}))
    assert told.startswith("bearing inboard cannot carry: from the ring yi must give ")
    assert f"one coil of 0.2 A, twice {bias}, gives " in told
    assert told.endswith(f"raise {bias}")


def test_what_the_rig_file_does_not_tell_is_named() -> None:
    rig = load_rig("amb5dof")
    none = rig.model_copy(update={"capabilities": rig.capabilities.model_copy(update={"model": {}})})
    told = carrying.told(RigFile.model_validate(none))
    assert "does not tell force constants (capabilities.model, beta_AXIS), so that" in told
    assert "yi must give " in told


def test_a_zero_that_is_told_far_from_the_coil_is_named_too() -> None:
    """From the ring with the zero 150 um beyond the magnets' middle, where without that the coil could lift."""
    rig = load_rig("amb5dof")
    bias, offset = conventions(rig).biases["yo"], conventions(rig).model_offset("yo")
    middle, far = (with_defaults(rig, **{bias: 0.8, offset: d}) for d in (0.0, -1.5e-4))
    assert "each axis can carry its share" in carrying.told(middle)
    told = carrying.told(far)
    assert told.startswith("bearing outboard cannot carry: from the ring yo must give ")
    assert f"raise {bias}, or look at its probe: its zero is told 150 µm beyond the magnets' middle" in told
    assert told.endswith("and a zero that is off explains it as well")
