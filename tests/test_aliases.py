"""A rig's own names of quantities at its places, and both names wherever one is asked for."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from test_rigfile import DBC, TOML, changed, of_schema_1, problems

from bench.campaign import Campaign
from bench.cli.campaign.steps import planned
from bench.cli.loading import load_procedure
from bench.errors import ConfigError
from bench.findings import Effect, Finding
from bench.procedure import Measured, Quantity
from bench.procedure.names import by_names_of, quantities_on
from bench.record.specs import load_spec
from bench.rigfile import RigFile, load_rig
from bench.rigfile.aliases import by_names, in_full, known_as, names_meant, renamed, with_full_names
from bench.uncertainty import Estimate
from sim_backend.truth import draw

ALIASES = {"K_i": "K@inboard", "K_o": "K@outboard", "error_y": "error@y"}
K = Quantity("K", "N/A", "dF/di")
RIGS = Path(__file__).resolve().parents[1] / "rigs"


@pytest.mark.parametrize(
    ("full", "own"),
    [("K@inboard", "K_i"), ("K@inboard, 3", "K_i@3"), ("error@y, CCS, 10 Hz", "error_y@CCS, 10 Hz"), ("K@middle", "K@middle"),
     ("K@3, inboard", "K@3, inboard"), ("s_max@yi", "s_max@yi"), ("B", "B")],
)  # fmt: skip
def test_each_name_is_told_by_the_other(full: str, own: str) -> None:
    assert known_as(ALIASES, full) == own
    assert in_full(ALIASES, own) == full
    assert (known_as(ALIASES, own), in_full(ALIASES, full)) == (own, full)


def test_a_name_without_its_place_is_all_of_its_kind() -> None:
    assert names_meant(ALIASES, ["K", "@y", "B", "K@outboard"]) == ("K_i", "K_o", "@y", "B")
    assert by_names(ALIASES, {"K@outboard": 1, "K": 2, "B": 3}) == {"K_o": 1, "K_i": 2, "B": 3}
    assert by_names(ALIASES, {"K": 2, "K_o": 1}) == {"K_i": 2, "K_o": 1}
    assert with_full_names(ALIASES, {"K_i@3": 1}) == {"K_i@3": 1, "K@inboard, 3": 1}
    assert renamed({}, "K", "inboard") == ("K", "inboard")


def test_what_is_measured_goes_by_the_rigs_name() -> None:
    made = by_names_of(ALIASES, K.measured(Estimate.exact(3.0), "outboard, 5"))
    assert isinstance(made, Measured)
    assert (made.quantity.name, made.where) == ("K_o", "5")
    assert made.quantity in quantities_on(ALIASES, [K])
    assert [q.name for q in quantities_on(ALIASES, [K])] == ["K_i", "K_o"]
    assert quantities_on({}, [K]) == (K,)
    doubt = by_names_of(ALIASES, Finding("doubt", "", "", Effect.INDETERMINATE, ("K@inboard", "@y")))
    assert isinstance(doubt, Finding)
    assert doubt.concerns == ("K_i", "@y")


@pytest.mark.parametrize("name", ["tsbs12", "amb5dof"])
def test_a_rig_file_without_the_table_has_the_names_of_before(name: str) -> None:
    """In schema 2 and in schema 1, where the parts are called so; an empty table is none."""
    toml, dbc = ((RIGS / f"{name}.{x}").read_text(encoding="utf-8") for x in ("toml", "dbc"))
    stated = RigFile.parse(toml, dbc).aliases
    begin, end = toml.index("[aliases]"), toml.index("[parameters]")
    assert RigFile.parse(of_schema_1(toml), dbc).aliases == stated
    assert RigFile.parse(toml[:begin] + toml[end:], dbc).aliases == stated
    assert RigFile.parse(f"{toml[:begin]}[aliases]\n{toml[end:]}", dbc).aliases == {}
    example = RIGS.parent / "examples" / "plain-stand" / "stand.toml"
    assert load_rig(str(example)).aliases == {}


@pytest.mark.parametrize(
    ("old", "new", "key", "expected"),
    [
        ('K_i = "K@inboard"', 'K_i = "K@inbord"', "aliases.K_i", "a place of the rig, such as inboard"),
        ('K_o = "K@outboard"', 'K_o = "K@inboard"', "aliases.K_o", "one name of it; K_i is another"),
        ('K_i = "K@inboard"', 'K_i = "K"', "aliases.K_i", "pattern"),
    ],
)
def test_a_name_that_leads_nowhere_is_refused(tmp_path: Path, old: str, new: str, key: str, expected: str) -> None:
    assert expected in problems(tmp_path, changed(TOML, (old, new)))[key].expected


def limited(folder: Path, *keys: str) -> set[str]:
    """The limits of the angle step for these names."""
    lines = [f'"{key}" = {{ high = 1, unit = "m", source = "house", verified = false }}' for key in keys]
    (folder / "tsbs12.toml").write_text("\n".join(["schema = 1", "[limits.angle-step]", *lines]))
    return {*load_spec("tsbs12", "angle-step", load_procedure("angle-step"), (folder,), rig=load_rig("tsbs12"))}


def test_a_limit_may_go_by_either_name(tmp_path: Path) -> None:
    assert limited(tmp_path, "peak@motor") == limited(tmp_path, "peak_motor") == {"peak_motor"}
    assert limited(tmp_path, "peak") == {"peak_outboard", "peak_motor"}
    assert limited(tmp_path, "peak@motor, static") == {"peak_motor@static"}
    with pytest.raises(ConfigError, match=r"two limits of the same; expected one of peak@motor, peak_motor"):
        limited(tmp_path, "peak@motor", "peak_motor")


def test_a_campaign_may_go_by_either_name() -> None:
    text = 'schema = 1\nname = "c"\nrig = "tsbs12"\n[[step]]\nprocedure = "angle-step"\njudged = ["peak@motor"]\n'
    rig = RigFile.parse(TOML, DBC)
    (step,) = planned(Campaign.parse(text), "c.toml", rig, short=True)
    assert step.judged == ("peak_motor",)
    assert {"peak_motor", "peak_outboard"} <= {q.name for q in step.procedure.measures}
    assert json.dumps([q.name for q in step.procedure.measures]).count('"peak"') == 0


def test_a_drawn_value_goes_before_a_quantity_of_its_name() -> None:
    """`hanger` is a weight that is drawn, and what amb-calibration finds of it at each bearing."""
    rig = load_rig("tsbs12")
    assert draw(rig, 0, {"hanger": 0.3}).values["hanger"] == 0.3
