"""The journal and the directory of a campaign: what a kill leaves, and what may be gone on with."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bench.campaign.directory import newest, opened
from bench.campaign.journal import Journal
from bench.errors import ConfigError

ENTRIES = st.dictionaries(st.text(max_size=3), st.text(max_size=5) | st.integers() | st.none())


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.dictionaries(st.text(max_size=3), st.text(max_size=5) | st.integers() | st.none()), max_size=4),
    st.data(),
)
def test_a_journal_cut_anywhere_has_every_whole_line(
    tmp_path: Path, entries: list[dict[str, object]], data: st.DataObject
) -> None:
    journal = Journal(tmp_path / "journal.jsonl")
    journal.path.unlink(missing_ok=True)
    for entry in entries:
        journal.append(entry)
    content = journal.path.read_bytes() if entries else b""
    cut = data.draw(st.integers(0, len(content)))
    journal.path.write_bytes(content[:cut])
    whole = content[:cut].count(b"\n")
    assert list(journal.entries()) == entries[:whole]
    journal.repair()
    journal.append({"after": "the kill"})
    assert list(journal.entries()) == [*entries[:whole], {"after": "the kill"}]


def test_a_broken_line_in_the_middle_is_named(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal.jsonl")
    journal.path.write_text('{"a": 1}\n{"a": \n{"a": 3}\n')
    with pytest.raises(ConfigError, match=r"line 2: .* delete that line"):
        list(journal.entries())


def test_not_a_number_is_never_written(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal.jsonl")
    with pytest.raises(ValueError, match="JSON"):
        journal.append({"x": float("nan")})
    assert list(journal.entries()) == []


def test_an_unfinished_campaign_is_gone_on_with(tmp_path: Path) -> None:
    first, resumed = opened(tmp_path, "c", {"plan": {"s": 1}}, new=False)
    assert not resumed
    first.journal.append({"kind": "rig"})
    again, resumed = opened(tmp_path, "c", {"plan": {"s": 1}}, new=False)
    assert resumed
    assert again == first
    again.journal.append({"kind": "done"})
    third, resumed = opened(tmp_path, "c", {"plan": {"s": 1}}, new=False)
    assert not resumed
    assert third != first


def test_a_changed_campaign_is_refused_with_the_remedy(tmp_path: Path) -> None:
    first, _ = opened(tmp_path, "c", {"steps": [{"s": 1, "t": 2}], "seed": 1}, new=False)
    with pytest.raises(ConfigError) as caught:
        opened(tmp_path, "c", {"steps": [{"s": 1, "t": 3}], "seed": 1}, new=False)
    assert str(first.path) in str(caught.value)
    assert "steps.1.t: started with 2, now 3" in str(caught.value)
    assert "--new" in str(caught.value)
    second, resumed = opened(tmp_path, "c", {"steps": []}, new=True)
    assert not resumed
    assert newest(tmp_path, "c") == second


def test_another_campaign_is_none_of_ours(tmp_path: Path) -> None:
    opened(tmp_path, "c-long", {"a": 1}, new=False)
    assert newest(tmp_path, "c") is None
    (tmp_path / "c.campaign-notes").mkdir()
    assert newest(tmp_path, "c") is None


def test_a_directory_that_was_not_finished_being_made_is_none(tmp_path: Path) -> None:
    (tmp_path / "c.campaign-20260101T000000Z-abcd").mkdir()
    assert newest(tmp_path, "c") is None


def test_one_process_at_a_time(tmp_path: Path) -> None:
    directory, _ = opened(tmp_path, "c", {}, new=False)
    with directory.locked(), pytest.raises(ConfigError, match=f"another process works .* process {os.getpid()}"):
        with directory.locked():
            pass
    with directory.locked():
        pass


def test_a_file_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "runs").write_text("")
    with pytest.raises(ConfigError, match="--out"):
        opened(tmp_path / "runs", "c", {}, new=False)
