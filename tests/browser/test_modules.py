"""The page's modules that read bytes and make texts, in the browser, against numpy and the reports."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from standin import Standin

from reports.text import rounded_together

LOADED = """Promise.all(["stream", "buffers", "text", "orbits"].map((n) => import(`/${n}.js`))).then((found) =>
  Object.assign(window, ...found))"""
PARSED = """([text, cuts]) => { const told = []; const push = eventParser((name, data) => told.push([name, data]));
  let at = 0; for (const cut of [...cuts, text.length]) { push(text.slice(at, cut)); at = cut; } return told; }"""
VIEWED = """([blocks, seconds, points]) => {
  const history = new History(["a", "b"]);
  for (const block of blocks) history.append(block);
  const view = history.view(seconds, points);
  const bands = ["a", "b"].map((name) => bandOf(view, name, { factor: 2, offset: 1 }));
  return { x: view.x, spans: view.spans, t: [...view.rows.t.slice(0, view.rows.n)], bands, last: history.last };
}"""
STREAMED = settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(scope="module")
def modules(chromium: Any) -> Iterator[Any]:
    """A page that has loaded them, and asks for nothing more."""
    with Standin() as server:
        page = chromium.new_page()
        page.goto(f"http://127.0.0.1:{server.server_port}/")
        page.evaluate(LOADED)
        yield page
        page.close()


LINES = st.text(st.characters(codec="utf-8", exclude_characters="\r\n"), max_size=20)
NAMES = st.text(st.characters(codec="ascii", categories=["L"]), min_size=1, max_size=8)


@STREAMED
@given(st.lists(st.tuples(NAMES, st.lists(LINES, min_size=1, max_size=3), st.booleans())), st.sampled_from(["\n", "\r\n"]),
       st.lists(st.integers(0, 500), max_size=10))  # fmt: skip
def test_events_are_told_however_the_stream_is_cut(
    modules: Any, events: list[tuple[str, list[str], bool]], end: str, cuts: list[int]
) -> None:
    text = "".join(
        f"{f': life{end}{end}' if life else ''}event: {name}{end}{''.join(f'data: {line}{end}' for line in lines)}{end}"
        for name, lines, life in events
    )
    units = len(text.encode("utf-16-le")) // 2
    found = modules.evaluate(PARSED, [text, sorted(min(c, units) for c in cuts)])
    assert found == [[name, "\n".join(lines)] for name, lines, _ in events]


@STREAMED
@given(st.text(max_size=200), st.lists(st.integers(0, 200), max_size=5))
def test_no_text_raises_in_the_parser(modules: Any, text: str, cuts: list[int]) -> None:
    text = text.encode("utf-8", "replace").decode()
    modules.evaluate(PARSED, [text, sorted(min(c, len(text)) for c in cuts)])


@STREAMED
@given(st.lists(st.floats(width=32, allow_nan=False, allow_infinity=False), max_size=50))
def test_numbers_arrive_as_they_were_sent(modules: Any, values: list[float]) -> None:
    for kind, reader in (("<f4", "float32"), ("<f8", "float64")):
        sent = base64.b64encode(np.array(values, kind).tobytes()).decode()
        assert [float(v) for v in modules.evaluate(f"(text) => [...{reader}(text)]", sent)] == values


def sent(t: Any, low: Any, high: Any) -> dict[str, Any]:
    def packed(values: Any, kind: str) -> str:
        return base64.b64encode(np.asarray(values, kind).tobytes()).decode()

    a = {"min": packed(low, "<f4"), "max": packed(high, "<f4"), "last": 0.0}
    return {"t": packed(t, "<f8"), "channels": {"a": a}}


@STREAMED
@given(st.lists(st.tuples(st.integers(1, 60), st.floats(-1, 1, width=32)), min_size=2, max_size=120), st.integers(1, 20),
       st.floats(0.5, 30), st.integers(5, 200))  # fmt: skip
def test_a_view_shows_the_least_and_greatest_of_its_rows_and_breaks_at_gaps(
    modules: Any, rows: list[tuple[int, float]], size: int, seconds: float, points: int
) -> None:
    """Blocks overlap by one bucket, which the later one completes."""
    t = np.cumsum([step for step, _ in rows]) * 0.01
    low = np.array([value for _, value in rows], "f4")
    high = low + np.float32(0.5)
    blocks = [sent(t[k : k + size + 1], low[k : k + size + 1], high[k : k + size + 1]) for k in range(0, len(t), size)]
    found = modules.evaluate(VIEWED, [blocks, seconds, points])
    assert found["t"] == list(t)
    shown = [span for span in found["spans"] if span is not None]
    inside = np.flatnonzero(t >= t[-1] - seconds)
    assert [k for a, b in shown for k in range(a, b)] == list(inside)
    assert all(a < b for a, b in zip(found["x"], found["x"][1:], strict=False))
    step = max(seconds / points, 0.0)
    breaks = np.count_nonzero(np.diff(t[inside]) > max(0.25, 3 * step))
    assert found["spans"].count(None) == breaks
    (lows, highs), (other, _) = found["bands"]
    for span, a, b in zip(found["spans"], lows, highs, strict=True):
        assert (a is None) == (b is None) == (span is None)
        if span is not None:
            assert t[span[1] - 1] - t[span[0]] <= step + 1e-9
            assert (a, b) == ((low[slice(*span)].min() - 1) / 2, (high[slice(*span)].max() - 1) / 2)
    assert other == [None] * len(other)  # a channel of which nothing came


def test_the_bucket_that_comes_twice_keeps_both_halves(modules: Any) -> None:
    blocks = [sent([0.0, 0.01], [0, -5], [1, 1]), sent([0.01, 0.02], [0, 0], [9, 1])]
    found = modules.evaluate(VIEWED, [blocks, 10, 1000])
    assert found["bands"][0][0] == [-0.5, -3.0, -0.5]
    assert found["bands"][0][1] == [0.0, 4.0, 0.0]


def test_twenty_minutes_are_kept_and_two_of_them_in_full(modules: Any) -> None:
    """Longer than is kept: the oldest gave way, and a peak that lasted one bucket is still there in the coarse rows."""
    t = np.arange(150_000) / 100
    low = np.zeros(t.size)
    high = np.zeros(t.size)
    high[60_007] = 7.0
    blocks = [sent(t[k : k + 5000], low[k : k + 5000], high[k : k + 5000]) for k in range(0, t.size, 5000)]
    wide = modules.evaluate(VIEWED, [blocks, 1200, 600])
    assert len(wide["x"]) == pytest.approx(600, abs=2)
    assert wide["x"][0] == pytest.approx(300, abs=2)
    assert max(wide["bands"][0][1]) == 3.0
    fine = modules.evaluate(VIEWED, [blocks, 10, 100_000])
    assert fine["x"] == list(t[t >= t[-1] - 10])


def test_results_are_rounded_as_in_reports(modules: Any) -> None:
    rng = np.random.default_rng(1)
    U = 10 ** rng.uniform(-4.5, 5, 300)
    values = U * 10 ** rng.uniform(-1, 3, 300) * rng.choice([-1, 1], 300)
    found = modules.evaluate(
        "(pairs) => pairs.map(([v, u]) => withUncertainty(v, u))", np.transpose([values, U]).tolist()
    )
    compared = 0
    for value, u, told in zip(values, U, found, strict=True):
        (number,), width, shift = rounded_together([value], u)
        if shift == 0:  # reports take powers of ten out, also of large numbers
            assert told == [
                number.replace("\u202f", "").replace("\u2009", ""),
                width.replace("\u202f", "").replace("\u2009", ""),
            ]
            compared += 1
    assert compared > 150
    assert modules.evaluate("withUncertainty(-7.0042e-9, 2.1e-11)") == ["−7.004·10⁻⁹", "0.021·10⁻⁹"]
    assert modules.evaluate("withUncertainty(null, 1)") == ["–", "–"]


@pytest.mark.parametrize(
    ("x", "zoom", "half"), [([1e-5], False, 250e-6), ([3e-4], False, 3e-4), ([1e-5], True, 1e-5), ([], True, 1e-7)]
)
def test_an_orbit_fits_with_its_ring_or_fills_the_picture(
    modules: Any, x: list[float], zoom: bool, half: float
) -> None:
    orbit = {"clearance_m": 250e-6, "zones": [{"name": "A/B", "radius_m": 75e-6}]}
    found = modules.evaluate("([orbit, x, zoom]) => scaleOf(orbit, x, x, zoom)", [orbit, x, zoom])
    assert found["half"] == pytest.approx(1.12 * half)
    assert 0.1 < found["bar"] / found["half"] < 0.6
