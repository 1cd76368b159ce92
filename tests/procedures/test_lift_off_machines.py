"""Lift-off on machines whose constants are known: how early an end goes, machines that nearly lift at 0, other shafts."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from identified import estimates, serious
from reanalysed import reanalysed

from bench.calibration import Calibration
from bench.cli.virtual import Simulated, simulated_run
from bench.rigfile import RigFile, load_rig
from bench.uncertainty import Estimate, Influence, interval
from procedures.lift_off import checks, fit
from procedures.lift_off.estimates import EARLY_HALF
from procedures.lift_off.plan import Plan
from procedures.lift_off.procedure import procedure
from procedures.servomotor import carrying
from procedures.servomotor.conventions import conventions
from sim_backend.core import plant as core
from sim_backend.machines.tsbs import liftoff
from sim_backend.machines.tsbs.params import ControlParams, PlantParams
from sim_backend.machines.tsbs.plant import CHANNELS, TRACE, Plant
from sim_backend.truth import draw

RIGS = Path(__file__).parents[2] / "rigs"
CLOSE, SLOW_DEG_S, LIMIT_A = "tsbs12-close", 0.2, 10.0
NEARLY = 10_000_186  # of tsbs12-close: presses with 0.46 N at gamma 0
KNOWN = {
    "force-constant": {"alpha_d": 1e-3, "alpha_d@0": 1e-3, "alpha_dx": 1e-3},
    "negative-stiffness": {"alpha_x_prime": 1e-3},
    "force-coupling": {"alpha_c": 1e-3, "gamma_0": 2e-4},
}  # u: a share of each constant, of gamma_0 rad


def own(rig: str, seed: int) -> dict[str, Calibration]:
    """The machine's own constants as its calibrations."""
    true = draw(load_rig(rig), seed).quantities
    true = {**true, "alpha_d@0": true["alpha_ratio"] * true["alpha_c"]}

    def one(of: str, name: str, share: float) -> Estimate:
        u = share if name == "gamma_0" else share * true[name]
        return Estimate.of(true[name], Influence(f"{of}/{name}", name, u, "1", "A", "normal", 20.0, "t"))

    return {
        of: Calibration(
            of, {name: one(of, name, u) for name, u in names.items()}, run_id=of, seed=seed, sha256="0" * 64
        )
        for of, names in KNOWN.items()
    }


def by_factor(known: dict[str, Calibration], factor: float) -> dict[str, Calibration]:
    motor = known["force-constant"]
    return {**known, "force-constant": replace(motor, values={n: e * factor for n, e in motor.values.items()})}


def flown(
    folder: Path, rig: str, seed: int, known: dict[str, Calibration], truth: dict[str, float] | None = None
) -> Simulated:
    plan = {"repeats": 2, "dwell_s": 0.5}
    return simulated_run("lift-off", rig, seed, plan, folder / f"{seed}.mcap", truth, known)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Simulated:
    return flown(tmp_path_factory.mktemp("sound"), "tsbs12", 4, own("tsbs12", 4))


@pytest.fixture(scope="module")
def nearly(tmp_path_factory: pytest.TempPathFactory) -> Simulated:
    return flown(tmp_path_factory.mktemp("nearly"), CLOSE, NEARLY, own(CLOSE, NEARLY))


def lifted(
    p: PlantParams, control: ControlParams, way: int, from_rad: float, rate_rad_s: float, seed: int
) -> tuple[float, float]:
    """The angle at which the core's end passes half of its depth, and the scatter of i_x before, A."""
    plant = Plant(p, seed, control=control)
    plant.mode = core.READY
    plant.run(3000)
    plant.mode = core.LIFT
    plant.run(10_000)
    plant.set("gamma", way * from_rad)
    plant.run(round((from_rad / control.gamma_slew + 0.5) * 1e4))
    depth = plant.run(1000)[:, CHANNELS.index("pos_yo")].mean()
    plant.set("gamma_slew", rate_rad_s)
    plant.set("gamma", way * math.radians(5.2))
    told: list[npt.NDArray[np.float64]] = []
    for _ in range(200):
        rows, trace = plant.run(1000, 1)
        told.append((rows[:, CHANNELS.index("i_m4")] - rows[:, CHANNELS.index("i_m2")]) / 2)
        up = np.flatnonzero(trace[:, TRACE.index("pos_yo")] > depth / 2)
        if len(up):
            i = np.concatenate(told[:-1])
            about = np.linspace(-1, 1, len(i))
            return float(trace[up[0], TRACE.index("gamma")]), float(
                np.std(i - np.polyval(np.polyfit(about, i, 2), about))
            )
    raise AssertionError("the end stays down")


@pytest.mark.parametrize(
    ("noise", "rate", "kd"),
    [(0.0, 0.2, 300.0), (0.75e-7, 0.2, 300.0), (1.5e-7, 0.2, 300.0), (3e-7, 0.2, 300.0), (5e-7, 0.2, 300.0),
     (1.5e-7, 0.05, 300.0), (1.5e-7, 0.3, 300.0), (1.5e-7, 0.2, 450.0)],
)  # fmt: skip
def test_how_early_an_end_goes_is_told_by_the_scatter_of_i_x(noise: float, rate: float, kd: float) -> None:
    """On the nominal machine, over four pairs, within the half width of the budget."""
    p, at = replace(PlantParams(), position_noise=noise), liftoff.resting(PlantParams())
    low, high = liftoff.thresholds(p, LIMIT_A) or (math.nan, math.nan)
    slope = (liftoff.surplus(p, at, high + 1e-3, LIMIT_A) - liftoff.surplus(p, at, high - 1e-3, LIMIT_A)) / 2e-3
    law = ControlParams(lift_by=1.0, allocation=1.0, lift_time_s=0.5, gamma_slew=math.radians(5), kd_m=kd)
    before = math.radians(max(0.2, rate))
    found = [
        [lifted(p, law, way, abs(to) - before, math.radians(rate), 100 * k + 7 + way) for way, to in ((-1, low), (1, high))]
        for k in range(4)
    ]  # fmt: skip
    early = slope * ((high - low) / 2 - float(np.mean([(b[0] - a[0]) / 2 for a, b in found])))
    shaken = float(np.mean([one[1] for pair in found for one in pair]))
    constants = {"alpha_d": p.alpha_d, "alpha_c": p.alpha_c, "gamma_0": 0.0, "pole_pairs": p.pole_pairs}
    expected = fit.early(constants, shaken, (high - low) / 2, slope * math.radians(rate))
    assert early == pytest.approx(expected, abs=EARLY_HALF[0] + EARLY_HALF[1] * expected)


def test_further_is_where_the_surplus_has_grown_by_so_much() -> None:
    """Of 2 g + 3 g^2; where it does not grow yet it bends, and where it does not bend it grows."""
    more, slope = fit.further(2.0, 6.0, 5.0)
    assert (more, slope) == (pytest.approx(1.0), pytest.approx(8.0))
    assert fit.further(0.0, 6.0, 3.0) == (pytest.approx(1.0), pytest.approx(6.0))
    assert fit.further(2.0, 0.0, 3.0) == (pytest.approx(1.5), pytest.approx(2.0))
    assert fit.further(-1.0, 0.0, 0.1) == (0.0, 1.0)


def test_a_machine_that_presses_lightly_has_an_angle(nearly: Simulated) -> None:
    """0.46 N: less than the noise of its start was once thought to take up."""
    p = draw(load_rig(CLOSE), NEARLY).plant
    at = liftoff.resting(p)
    assert -0.5 < liftoff.surplus(p, at, 0.0, LIMIT_A) < 0.0
    found = liftoff.thresholds(p, LIMIT_A)
    assert found is not None
    assert [liftoff.surplus(p, at, gamma, LIMIT_A) for gamma in found] == [pytest.approx(0.0, abs=1e-6)] * 2
    assert serious(nearly) == []
    for name, e in estimates(nearly).items():
        i = interval(e)
        assert abs(e.value - nearly.truth[name]) < 1.5 * (i.high - i.low) / 2, name


def test_a_lift_that_the_constants_do_not_foresee_is_corrected_and_told(nearly: Simulated) -> None:
    """With a force constant 0.8 % high they say that it lifts at 0, and the interval has an angle still; with 2 % none."""
    as_told = estimates(nearly)["gamma_lift"]
    almost = reanalysed(nearly, by_factor(own(CLOSE, NEARLY), 1.008))
    assert serious(almost) == []
    e, i = estimates(almost)["gamma_lift"], interval(estimates(almost)["gamma_predicted"])
    assert e.value == pytest.approx(as_told.value, abs=math.radians(0.003))
    assert e.u == pytest.approx(as_told.u, rel=0.1)
    assert "lift/early" in e.contributions
    assert (estimates(almost)["gamma_predicted"].value, i.low) == (0.0, 0.0)
    assert i.high > math.radians(0.3)
    never = reanalysed(nearly, by_factor(own(CLOSE, NEARLY), 1.02))
    (finding,) = serious(never)
    assert (finding.code, "they lift at 0" in finding.text) == ("lift-disagrees", True)
    assert "gamma_predicted" not in estimates(never)


@pytest.mark.parametrize("seed", [10_000_005, 10_000_009, 10_000_022])
def test_the_force_of_a_lift_at_zero_is_the_machines(tmp_path: Path, seed: int) -> None:
    """The inboard loop holds its actuators' plane: with that of its probes it was 3.7 N more."""
    known = own(CLOSE, seed)
    run = flown(tmp_path, CLOSE, seed, known)
    assert {f.code for f in serious(run)} == {"lifts-at-zero"}
    e = procedure.evaluated(run.recording).result.estimates["surplus"]
    p = draw(load_rig(CLOSE), seed).plant
    assert abs(e.value - liftoff.surplus(p, liftoff.resting(p), 0.0, LIMIT_A)) < interval(e).high - e.value < 1.8


def with_mass(folder: Path, kg: float) -> RigFile:
    """tsbs12 with what its shaft weighs."""
    for name in ("tsbs12.toml", "tsbs12.dbc"):
        shutil.copy(RIGS / name, folder)
    path = folder / "weighed.toml"
    path.write_text(
        'schema = 2\nbased_on = "tsbs12.toml"\nname = "weighed"\ntitle = "weighed"\n[shaft]\n'
        f'mass = {{ value = {kg}, unit = "kg", half_width = 0.1, distribution = "rectangular", source = "scales" }}\n'
    )
    return load_rig(path)


def test_plans_are_foreseen_by_the_weight_and_the_motor_that_the_rig_file_tells(tmp_path: Path) -> None:
    """A 20 kg shaft: by T's 10.2 kg a plan was foreseen to take half of its current, one of 6 kg was refused."""
    rig, heavy = load_rig("tsbs12"), with_mass(tmp_path, 20.0)
    told = heavy.site.gravity.value * 20.0 * carrying.lever(heavy)
    assert carrying.gravity_share_N(heavy) == pytest.approx(told)
    assert carrying.gravity_share_N(rig) == pytest.approx(10.2 * 9.81 * carrying.lever(rig))
    stronger = rig.parameters["model_alpha_d"].model_copy(update={"default": 24.2})
    other = rig.model_copy(update={"parameters": {**rig.parameters, "model_alpha_d": stronger}})
    assert carrying.newtons_per_A(other) == 24.2


def test_the_load_is_held_against_a_weight_that_the_rig_file_tells(sound: Simulated, tmp_path: Path) -> None:
    a, machine = procedure.evaluated(sound.recording).result, conventions(sound.recording.rig)

    def codes(rig: RigFile) -> set[str]:
        return {f.code for f in checks.of_place(a, rig, machine)}

    assert codes(with_mass(tmp_path, 10.2)) == set()
    assert codes(with_mass(tmp_path, 6.0)) == {"load-unexpected"}
    assert codes(load_rig("tsbs12")) == set()
    other = replace(a, newtons_A=a.newtons_A * 10.2 / 6.0)  # a motor that takes as much less current
    assert {f.code for f in checks.of_place(other, with_mass(tmp_path, 10.2), machine)} == {"load-unexpected"}


def test_a_shaft_of_another_weight_is_no_defect(tmp_path: Path) -> None:
    run = flown(tmp_path, "tsbs12", 4, own("tsbs12", 4), {"weight_left_kg": 1.4})
    assert "load-unexpected" not in {f.code for f in serious(run)}


def test_the_ripple_goes_with_the_encoders_counts(sound: Simulated) -> None:
    coarse = reanalysed(sound, encoder_counts=1024)
    a, b = (estimates(run)["gamma_lift"].contributions["lift/ripple"] for run in (sound, coarse))
    assert b > 1.5 * a
    result = procedure.evaluated(sound.recording).result
    turned = replace(result, ramps=[replace(r, angle=r.angle + 0.01) for r in result.ramps])
    assert [f.code for f in checks.of_rotor(turned, Plan())] == ["angle-moved"]
    assert list(checks.of_rotor(turned, Plan(encoder_counts=1024))) == []


@pytest.mark.parametrize(
    ("rests", "dwells", "told"),
    [([1.0], [1.0, 0.995], False), ([0.01], [1.0, 1.0], True), ([0.98], [1.0, 1.0], True), ([1.0], [0.51, 1.0], True)],
)
def test_contact_is_expected_all_the_time(
    sound: Simulated, rests: list[float], dwells: list[float], told: bool
) -> None:
    a, machine = procedure.evaluated(sound.recording).result, conventions(sound.recording.rig)
    assert ("contact-silent" in {f.code for f in checks.of_signals(a, machine, (rests, dwells), Plan())}) is told


def test_a_light_end_may_bounce_in_its_dwell(nearly: Simulated) -> None:
    a, machine = procedure.evaluated(nearly.recording).result, conventions(nearly.recording.rig)
    assert list(checks.of_signals(a, machine, ([1.0], [0.82, 0.9]), Plan())) == []
