"""Requests and replies: each has its own token, what is late or for others is not taken, held values stay."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.errors import ConfigError, NoReply
from bench.link import LinkStats
from bench.link.codec import Decoder, encode
from bench.link.frames import ERROR, FD, SENT, FrameBatch, empty_batch, frame, payload
from bench.link.session import Session
from bench.rigfile import RigFile, load_rig
from drivers import handshake
from drivers.dialogue import KEPT, Dialogue, commanded, status_of

ROOT = Path(__file__).resolve().parents[2]
NATIVE: RigFile = load_rig("tsbs12")
OWN: RigFile = load_rig(str(ROOT / "examples" / "own-controller" / "plainamb.toml"))
ME, OTHER = Session(0x1234501, 1_767_225_600, "me@here"), Session(0x55502, 1_767_225_500, "ann@lab process 7")
MESSAGES = NATIVE.messages
Answer = Callable[[str, dict[str, float]], list[FrameBatch]]


def message(name: str, **values: float) -> FrameBatch:
    return frame(MESSAGES[name].identifier, encode(MESSAGES[name], values), flags=FD)


class Conversation:
    """A dialogue whose other end is a function of what was asked. Its clock moves while the dialogue waits."""

    def __init__(self, answer: Answer, rig: RigFile = NATIVE) -> None:
        self._rig, self._answer = rig, answer
        self.name, self.stats, self.now = "controller", LinkStats(), 0
        self.reopening = False
        self.sent: list[FrameBatch] = []
        self._coming: list[FrameBatch] = []
        self.dialogue = Dialogue(rig, self, self.now_ns)

    def now_ns(self) -> int:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += round(seconds * 1e9)

    def send(self, batch: FrameBatch) -> None:
        self.sent.append(batch)
        for name, m in self._rig.messages.messages.items():
            values, _ = Decoder(m).decode(batch)
            if len(next(iter(values.values()))):
                self._coming += self._answer(name, {k: float(v[0]) for k, v in values.items()})

    def receive(self) -> FrameBatch:
        batch, self._coming = np.concatenate([empty_batch(), *self._coming]), []
        return batch

    def renew_lease(self) -> None:
        """Nothing beats here."""

    def close(self) -> None:
        """Nothing is open."""

    def wait(self, done: Callable[[], bool], timeout_s: float, what: str) -> None:
        end = self.now + round(timeout_s * 1e9)
        while not done():
            if self.now >= end:
                raise NoReply(f"waited for {what}")
            self.sleep(0.01)
            self.dialogue.take(self.receive())

    def set(self, value: float) -> dict[str, float]:
        return self.dialogue.ask("ParamSet", {"index": 1, "value": value}, "ParamReply", "the reply", self.wait)


def test_the_reply_is_the_one_with_the_token() -> None:
    def answer(name: str, v: dict[str, float]) -> list[FrameBatch]:
        late = message("ParamReply", index=1, token=(int(v["token"]) - 1) % 256, value=-1.0)
        return [late, message("ParamReply", index=1, token=v["token"], value=v["value"])]

    talk = Conversation(answer)
    assert [talk.set(float(k))["value"] for k in range(300)] == [float(k) for k in range(300)]
    assert payload(talk.sent[0][0]) == bytes.fromhex("0100 00000000 01 00")
    assert payload(talk.sent[255][0])[6] == 0  # tokens come round
    assert talk.sent[0]["flags"][0] == FD | SENT


@pytest.mark.parametrize("wrong", ["nothing", "token", "kind", "length"])
def test_without_its_reply_a_request_ends_after_three_times_half_a_second(wrong: str) -> None:
    def answer(name: str, v: dict[str, float]) -> list[FrameBatch]:
        reply = message("ParamReply", index=1, token=(int(v["token"]) + (wrong == "token")) % 256)
        if wrong == "length":
            reply["length"] = 7
        return {"nothing": [], "kind": [message("CommandReply", token=v["token"])]}.get(wrong, [reply])

    talk = Conversation(answer)
    with pytest.raises(NoReply, match="the reply, though it was asked for 3 times"):
        talk.set(1.0)
    assert talk.now == pytest.approx(1.5e9, abs=6e7)
    assert len({payload(b[0]) for b in talk.sent}) == 1
    assert len(talk.sent) == 3


def test_replies_with_another_token_are_told() -> None:
    talk = Conversation(lambda name, v: [message("ParamReply", index=1, token=77)])
    with pytest.raises(NoReply, match=r"3 times\. ParamReply with token 77 came; expected 1$"):
        talk.set(1.0)


@pytest.mark.parametrize("lost", [1, 2])
def test_a_lost_reply_costs_a_repeat_with_the_same_token(lost: int) -> None:
    asked = 0

    def answer(name: str, v: dict[str, float]) -> list[FrameBatch]:
        nonlocal asked
        asked += 1
        return [message("ParamReply", index=1, token=v["token"], value=v["value"])] if asked > lost else []

    talk = Conversation(answer)
    assert talk.set(2.0)["value"] == 2.0
    assert [payload(b[0]) for b in talk.sent] == [payload(talk.sent[0][0])] * (lost + 1)
    assert talk.dialogue.repeats == lost
    assert talk.dialogue.round_trip_ns is None  # nobody knows which one was answered
    talk.set(3.0)
    assert payload(talk.sent[-1][0])[6] == 2  # the next request has the next token
    assert talk.dialogue.round_trip_ns is not None


@pytest.mark.parametrize("between", [254, 255, 256, 511])
def test_two_equal_commands_never_have_one_token(between: int) -> None:
    """Whatever else was asked for between them: the second would be taken for a repeat, and not be executed."""

    def answer(name: str, v: dict[str, float]) -> list[FrameBatch]:
        reply = {"Command": "CommandReply", "ParamGet": "ParamReply"}[name]
        return [message(reply, token=v["token"])]

    talk, commands = Conversation(answer), []
    for _ in range(2):
        talk.dialogue.ask("Command", {"code": 4}, "CommandReply", "the reply", talk.wait)
        commands.append(payload(talk.sent[-1][0]))
        for _ in range(between):
            talk.dialogue.ask("ParamGet", {"index": 1}, "ParamReply", "the reply", talk.wait)
    assert commands[0] != commands[1]


def test_of_many_requests_only_the_lost_ones_are_sent_again() -> None:
    seen: list[int] = []

    def answer(name: str, v: dict[str, float]) -> list[FrameBatch]:
        seen.append(int(v["index"]))
        lost = v["index"] in (3, 5) and seen.count(int(v["index"])) < 2
        return [] if lost else [message("ParamReply", index=v["index"], value=v["index"])]

    talk = Conversation(answer)
    found = talk.dialogue.ask_all("ParamGet", [{"index": float(k)} for k in range(7)], "ParamReply", "index", talk.wait)
    assert {k: v["value"] for k, v in found.items()} == {float(k): float(k) for k in range(7)}
    assert seen == [0, 1, 2, 3, 4, 5, 6, 3, 5]
    assert talk.dialogue.repeats == 1


@pytest.mark.parametrize("length", [3, 5])
def test_a_reply_of_a_wrong_length_is_counted_and_named(length: int) -> None:
    def answer(name: str, v: dict[str, float]) -> list[FrameBatch]:
        reply = message("CommandReply", token=v["token"])
        reply["length"] = length
        return [reply]

    talk = Conversation(answer)
    says = f"waited for the reply to ENABLE, .* 3 times. A CommandReply of {length} bytes came, the DBC says 4: .*message map"
    with pytest.raises(NoReply, match=says):
        talk.dialogue.ask("Command", {"code": 1}, "CommandReply", "the reply to ENABLE", talk.wait)
    assert talk.dialogue.wrong_length == 3
    with pytest.raises(NoReply, match=r"the reply, .* times$"):  # of another kind: it does not explain this one
        talk.set(1.0)
    assert talk.dialogue.wrong_length == 6


def test_a_wrong_length_of_an_earlier_request_is_not_named() -> None:
    talk = Conversation(lambda name, v: [])
    short = message("ParamReply", index=1)
    short["length"] = 7
    talk.dialogue.take(np.concatenate([short, short]))
    with pytest.raises(NoReply, match=r"the reply, .* times$"):
        talk.set(1.0)
    assert talk.dialogue.wrong_length == 2


def test_a_wrong_length_before_the_right_one_does_no_harm() -> None:
    def answer(name: str, v: dict[str, float]) -> list[FrameBatch]:
        short = message("ParamReply", index=1, token=v["token"], value=9.0)
        short["length"] = 7
        return [short, message("ParamReply", index=1, token=v["token"], value=v["value"])]

    talk = Conversation(answer)
    assert talk.set(2.0)["value"] == 2.0
    assert talk.dialogue.wrong_length == 1


def test_a_destroyed_frame_is_no_reply() -> None:
    def answer(name: str, v: dict[str, float]) -> list[FrameBatch]:
        bad = [message("ParamReply", index=1, token=v["token"], value=9.0) for _ in range(2)]
        for reply in bad:
            reply["flags"] |= ERROR
        bad[1]["length"] = 3
        return [*bad, message("ParamReply", index=1, token=v["token"], value=v["value"])]

    talk = Conversation(answer)
    assert talk.set(2.0)["value"] == 2.0
    assert talk.dialogue.wrong_length == 0


def test_replies_to_others_do_not_pile_up() -> None:
    talk = Conversation(lambda name, v: [message("ParamReply", index=1, token=v["token"], value=2.0)])
    talk.dialogue.take(np.concatenate([message("ParamReply", token=k % 256, value=9.0) for k in range(4 * KEPT)]))
    assert len(talk.dialogue._answers) == KEPT
    assert talk.set(2.0)["value"] == 2.0


@settings(deadline=None, max_examples=60)
@given(
    st.lists(
        st.tuples(st.sampled_from([m.identifier for m in MESSAGES.messages.values()]), st.binary(max_size=64)),
        max_size=20,
    )
)
def test_arbitrary_bytes_never_crash(frames: list[tuple[int, bytes]]) -> None:
    talk = Conversation(lambda name, v: [])
    talk.dialogue.take(np.concatenate([empty_batch(), *(frame(i, d) for i, d in frames)]))
    with pytest.raises(NoReply):
        talk.set(1.0)


def test_held_values_stay_and_one_that_does_not_fit_is_not_kept() -> None:
    talk = Conversation(lambda name, v: [], OWN)
    talk.dialogue.hold("HostControl", "SpeedDemand", 3.0)
    talk.dialogue.hold("HostControl", "SpeedDemand", 9.0)  # it has been given
    talk.dialogue.send_held("HostControl", {"Demand": 2})
    talk.dialogue.send_held("HostControl", {"AngleDemand": -0.02})
    with pytest.raises(ConfigError, match="does not fit"):
        talk.dialogue.send_held("HostControl", {"SpeedDemand": 1e6})
    talk.dialogue.send_held("HostControl", {"Demand": 6})
    sent = [payload(b[0]).hex() for b in talk.sent]
    assert sent == ["021e000000000000", "021e00feffffff00", "061e00feffffff00"]
    assert talk.sent[0]["flags"][0] == SENT  # classic CAN


def test_commands_by_name_and_by_number() -> None:
    assert commanded(NATIVE, "LEVITATE") == {"Command": {"code": 2.0}}
    assert commanded(OWN, "LEVITATE") == {"HostControl": {"Demand": 2.0}}


def test_a_status_has_its_name_or_its_number() -> None:
    m = MESSAGES["CommandReply"]
    assert [status_of(m, {"status": k}) for k in (0.0, 4.0, 77.0)] == ["OK", "WRONG_SESSION", "status 77"]


def owner(who: Session) -> FrameBatch:
    return message("Owner", **who.fields())


def test_a_free_controller_is_claimed() -> None:
    talk = Conversation(lambda name, v: [owner(ME)])
    handshake.claim(talk.dialogue, NATIVE, ME, talk, talk.wait)
    assert len(talk.sent) == 1
    assert (
        payload(talk.sent[0][0])[:15] == ME.number.to_bytes(4, "little") + ME.since.to_bytes(4, "little") + b"me@here"
    )


def test_an_owner_that_has_gone_is_outwaited() -> None:
    talk = Conversation(lambda name, v: [owner(OTHER if talk.now < 1e9 else ME)])
    handshake.claim(talk.dialogue, NATIVE, ME, talk, talk.wait)
    assert 1e9 <= talk.now < 1.3e9


def test_an_owner_that_stays_is_named() -> None:
    talk = Conversation(lambda name, v: [owner(OTHER)])
    with pytest.raises(ConfigError, match=r"ann@lab process 7, session 0x00055502, since 2025-12-31 23:58:20 UTC"):
        handshake.claim(talk.dialogue, NATIVE, ME, talk, talk.wait)


def identity(protocol: int, map_version: int) -> Answer:
    return lambda name, v: [message("Identity", protocol=protocol, map_version=map_version, serial=1),
                            message("CommandReply", code=8, token=v["token"])]  # fmt: skip


def test_the_controller_that_the_rig_file_means() -> None:
    talk = Conversation(identity(1, 2))
    handshake.identify(talk.dialogue, NATIVE, ME, talk.wait)
    assert payload(talk.sent[0][0]) == ME.number.to_bytes(4, "little") + bytes([8, 0, 0, 0])


@pytest.mark.parametrize(("found", "says"), [((2, 2), "protocol 2"), ((1, 7), "map_version 7")])
def test_another_firmware_is_refused(found: tuple[int, int], says: str) -> None:
    talk = Conversation(identity(*found))
    with pytest.raises(ConfigError, match=f"{says}.*tsbs12.toml.*update the firmware"):
        handshake.identify(talk.dialogue, NATIVE, ME, talk.wait)


def test_a_controller_that_knows_neither_is_asked_nothing() -> None:
    talk = Conversation(lambda name, v: [], OWN)
    handshake.claim(talk.dialogue, OWN, ME, talk, talk.wait)
    handshake.identify(talk.dialogue, OWN, ME, talk.wait)
    assert talk.sent == []
