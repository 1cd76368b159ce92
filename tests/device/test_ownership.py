"""Whom the simulated controller obeys: taken when free, kept while alive or turning, free again after silence at rest."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from bench.link.session import Session
from sim_backend.controller.ownership import NAME_PARTS, TAKEOVER_S, Ownership
from sim_backend.core import TICK_S

SECOND = round(1 / TICK_S)
ANN, BOB = Session(0x101, 100, "ann"), Session(0x202, 200, "bob")


def claim(owner: Ownership, who: Session, tick: int, resting: bool = True) -> Session:
    return Session.of(owner.claim({k: float(v) for k, v in who.fields().items()}, tick, resting))


def beat(owner: Ownership, session: int, counter: int, tick: int) -> None:
    owner.beat(session, counter, tick)


def test_the_first_that_asks_has_it_and_the_second_is_told_who() -> None:
    owner = Ownership()
    assert claim(owner, ANN, 0) == ANN
    assert claim(owner, BOB, 10) == ANN
    assert not owner.takes(BOB.number, 10, True)
    assert owner.takes(ANN.number, 10, True)


def test_session_zero_is_nobody() -> None:
    owner = Ownership()
    assert not owner.takes(0, 0, True)
    assert not owner.may_write(0)
    claim(owner, ANN, 0)
    assert not owner.takes(0, 5 * SECOND, True)
    assert owner.session == ANN.number


def test_an_owner_that_is_silent_for_a_second_is_forgotten_only_at_rest() -> None:
    owner = Ownership()
    claim(owner, ANN, 0)
    later = round(TAKEOVER_S * SECOND)
    assert not owner.takes(BOB.number, later, True)
    assert not owner.takes(BOB.number, later + 1, False)
    owner.arm(0)
    assert claim(owner, BOB, later + 1) == BOB
    assert not owner.armed
    assert not owner.takes(ANN.number, later + 2, True)


def test_an_owner_that_comes_back_before_another_asks_is_still_the_owner() -> None:
    owner = Ownership()
    claim(owner, ANN, 0)
    assert owner.takes(ANN.number, 60 * SECOND, True)
    assert claim(owner, BOB, 60 * SECOND) == BOB  # it asked, but showed no heartbeat


def test_heartbeats_keep_it_and_a_counter_that_stands_still_does_not() -> None:
    owner = Ownership()
    claim(owner, ANN, 0)
    beat(owner, ANN.number, 1, 100)
    assert owner.heartbeat == 100
    beat(owner, ANN.number, 1, 300)
    assert owner.heartbeat == 100
    beat(owner, BOB.number, 7, 400)
    assert (owner.heartbeat, owner.session) == (100, ANN.number)
    beat(owner, ANN.number, 0, 500)
    assert owner.heartbeat == 500


def test_a_heartbeat_takes_nothing() -> None:
    owner = Ownership()
    beat(owner, ANN.number, 0, 50)
    assert (owner.session, owner.heartbeat) == (0, 0)
    claim(owner, ANN, 60)
    owner.release()
    beat(owner, ANN.number, 1, 70)  # the last one of a host that leaves
    assert claim(owner, BOB, 80) == BOB


def test_a_command_takes_a_free_controller_without_a_name() -> None:
    owner = Ownership()
    assert owner.takes(ANN.number, 50, True)
    assert owner.claim({**{k: float(v) for k, v in BOB.fields().items()}}, 60, True) == {
        "session": ANN.number,
        "since": 0,
    }


def test_a_new_owners_first_heartbeat_counts_whatever_the_last_ones_counter_was() -> None:
    owner = Ownership()
    claim(owner, ANN, 0)
    beat(owner, ANN.number, 9, 0)
    owner.release()
    claim(owner, BOB, 30)
    beat(owner, BOB.number, 9, 40)
    assert owner.heartbeat == 40
    assert owner.counter == 9


def test_writes_are_told_by_the_low_byte() -> None:
    owner = Ownership()
    assert not owner.may_write(ANN.low_byte)
    claim(owner, ANN, 0)
    assert owner.may_write(ANN.low_byte)
    assert not owner.may_write(BOB.low_byte)
    owner.release()
    assert not owner.may_write(ANN.low_byte)


ACTIONS = st.lists(st.tuples(st.sampled_from(["claim", "beat", "takes"]), st.integers(0, 3), st.integers(0, 3),
                             st.integers(0, 2 * SECOND), st.booleans()), max_size=40)  # fmt: skip


@given(ACTIONS)
def test_nobody_loses_it_while_turning_or_alive(actions: list[tuple[str, int, int, int, bool]]) -> None:
    owner, tick = Ownership(), 0
    for kind, session, counter, step, resting in actions:
        tick += step
        before, sign_of_life = owner.session, owner.heartbeat
        if kind == "claim":
            answer = owner.claim({**Session(session, 1, "x").fields()}, tick, resting)
            assert answer["session"] == owner.session
            assert set(answer) <= {"session", "since", *NAME_PARTS}
        elif kind == "beat":
            beat(owner, session, counter, tick)
        else:
            assert owner.takes(session, tick, resting) == (owner.session == session != 0)
        if before and owner.session != before:
            assert resting
            assert (tick - sign_of_life) * TICK_S > TAKEOVER_S
            assert owner.session == session
