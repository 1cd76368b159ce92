"""Bit rates for which SLCAN has no code are told by `bench check`, not by the adapter at the start of a run."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_rigfile import TOML, changed, problems, written

from bench.rigfile.check import check_rig

RATES = "bitrate = 1_000_000\ndata_bitrate = 5_000_000\n"


@pytest.mark.parametrize(
    ("rates", "key", "found", "among"),
    [
        ("bitrate = 1_000_000\ndata_bitrate = 4_000_000\n", "data_bitrate", "4000000", "2000000, 5000000"),
        ("bitrate = 400_000\ndata_bitrate = 2_000_000\n", "bitrate", "400000", "250000, 500000, 800000"),
        ("bitrate = 750e3\ndata_bitrate = 2_000_000\n", "bitrate", "750000", "500000, 800000, 1000000"),
    ],
)
def test_a_rate_that_slcan_lacks_is_named(tmp_path: Path, rates: str, key: str, found: str, among: str) -> None:
    (p,) = (p for p in check_rig(written(tmp_path, changed(TOML, (RATES, rates))))[0])
    assert (p.key, p.found) == (f"links.controller.{key}", found)
    assert among in p.expected


def test_rates_of_the_url_and_of_other_adapters(tmp_path: Path) -> None:
    url = 'url = "slcan:socket://127.0.0.1:28501"'
    other = changed(TOML, (url, 'url = "can:socketcan:can0"'), (RATES, RATES.replace("5_", "4_")))
    assert check_rig(written(tmp_path, other))[0] == ()
    stated = changed(TOML, (url, f'{url[:-1]}?data_bitrate=8000000"'), (RATES, RATES.partition("data")[0]))
    assert "links.controller.data_bitrate" in problems(tmp_path, stated)
    fine = changed(TOML, (RATES, "bitrate = 500e3\ndata_bitrate = 2e6\n"))
    assert not [p for p in check_rig(written(tmp_path, fine))[0] if p.key.startswith("links.")]
