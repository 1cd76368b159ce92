"""What listening makes of what comes: sound telemetry, and every wrong turn with its next step, as the screen has it."""

from __future__ import annotations

import dataclasses
import re
import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from heard import SILENT, START_NS, hear, listening, readings, telemetry

from bench.cli.listen.screen import line, screen
from bench.cli.listen.summary import summary
from bench.cli.listen.unfinished import listenable
from bench.errors import ConfigError
from bench.link.codec import encode
from bench.link.frames import ERROR, EXTENDED, FrameBatch, batch_of, empty_batch, frame, joined, packed
from bench.link.listened import Ear, Listened
from bench.link.readings import Scale
from bench.link.troubles import remark, troubles

ROOT = Path(__file__).resolve().parents[1]


def texts(heard: Listened) -> dict[str, str]:
    return {t.key: t.text for t in troubles(heard)}


def shown(heard: Listened, columns: int = 80, rows: int = 24) -> str:
    """The screen, of which every line fits, and so do they all."""
    lines = screen(heard, troubles(heard), {}, columns, rows)
    assert len(lines) <= rows
    assert max(map(len, lines)) <= columns
    whole = summary(heard, troubles(heard), {}, 80)
    assert max(map(len, whole.splitlines())) <= 80
    return "\n".join(lines)


def of_tsbs12(count: int = 2500, seconds: float = 2.5, **changes: object) -> Listened:
    heard = listening()
    return hear(heard, telemetry(heard.rig, count, **changes), seconds)  # type: ignore[arg-type]


def test_sound_telemetry_is_shown_and_nothing_is_wrong() -> None:
    heard = of_tsbs12(8000, 8.0)
    assert texts(heard) == {}
    text = shown(heard)
    assert "telemetry  1000/s of 1000/s   lost 0   leapt 0   tick +0 ± " in text
    assert "state      OFF   fault NONE" in text
    assert "another host: none heard" in text
    assert "pos_xi" in text
    assert "µm" in text
    assert "temp_m" in text
    assert "Ctrl-C ends" in text
    assert line(heard) == "    8 s  telemetry 1000/s  lost 0  unknown 0  OFF  fault NONE"
    told = summary(heard, [], {}, 80)
    assert "samples   8000 at 1000/s, by the DBC 1000/s; lost 0 in 0 gaps" in told
    assert "wrong     nothing" in told
    assert "did not come, as nobody asked: CommandReply" in told
    assert "  speed                        0.00         0.00         0.00 r/min stands" in told


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (80, 12), (132, 50), (60, 24), (40, 10)])
def test_the_screen_fits(columns: int, rows: int) -> None:
    heard = of_tsbs12()
    strange = joined([frame(0x300 + k, bytes(8), t_ns=START_NS + 1) for k in range(30)])
    hear(heard, strange, 2.5, malformed=3, crc_errors=2, adapter_overruns=1)
    shown(heard, columns, rows)


def test_other_hosts_and_unknown_identifiers_are_counted() -> None:
    heard = listening()
    count = 2500
    beat = heard.rig.messages["Heartbeat"].identifier
    others = [packed(beat, bytes(8), t_ns=START_NS + k * 20_000_000) for k in range(125)]
    others += [packed(0x3A0, bytes(5), t_ns=START_NS + k * 100_000_000) for k in range(25)]
    others += [packed(0x12345 | EXTENDED, bytes(8), t_ns=START_NS + k * 500_000_000) for k in range(5)]
    hear(heard, joined([telemetry(heard.rig, count), batch_of(others)]), 2.5)
    assert re.search("another host: Heartbeat (49|50|51)", shown(heard))
    assert list(texts(heard)) == ["unknown"]
    told = shown(heard).replace("\n  ", " ")
    assert "2 identifiers that the DBC does not know: 0x3A0 (25, " in told
    assert re.search(r"0x00012345 \(5, (2|1.5)/s, 8 bytes\)", told)
    told = summary(heard, troubles(heard), {}, 80)
    assert "  Heartbeat (a host's)          0x010       8       125" in told
    assert "  unknown                  0x00012345       8         5" in told


def test_a_wrong_length_is_told_beside_the_dbcs() -> None:
    heard = listening()
    batch = telemetry(heard.rig, 2500)
    batch["length"] = 48
    hear(heard, batch, 2.5)
    text = texts(heard)["length-Telemetry"]
    assert "Telemetry (0x100): 2500 frames of 48 bytes, the DBC says 64" in text
    assert "Next: compare the firmware's message map with tsbs12.dbc" in text
    assert "telemetry  1000/s of 1000/s" in shown(heard)
    assert "never came" in summary(heard, troubles(heard), {}, 80)


def test_the_segments_of_an_upload_have_no_wrong_length() -> None:
    heard = listening("amb5dof")
    block, status = (heard.rig.messages[n].identifier for n in ("CaptureBlock", "CaptureStatus"))
    hear(heard, joined([frame(block, bytes(12), t_ns=START_NS), frame(status, bytes(8), t_ns=START_NS)]), 0.1)
    assert [m.name for m, _ in heard.census.misshapen] == ["CaptureStatus"]  # the bus has CAN FD


@pytest.mark.parametrize(("signal", "plain"), [("seq", "sequence"), ("tick", "tick")])
def test_a_counter_that_stands_is_told(signal: str, plain: str) -> None:
    heard = of_tsbs12(values=lambda k: {**readings(k), signal: 77})
    assert f"Telemetry.{signal} stands while frames come" in texts(heard)[f"stands-{plain}"]
    assert "pos_xi" in shown(heard)
    assert heard.readings.by_name["pos_xi"].moves  # the readings are live all the same


def test_counters_in_the_other_byte_order_are_told() -> None:
    def swapped(k: int) -> Mapping[str, float]:
        return {**readings(k), "seq": int.from_bytes((k % 65536).to_bytes(2, "big"), "little"),
                "tick": int.from_bytes((10 * k).to_bytes(4, "big"), "little")}  # fmt: skip

    found = texts(of_tsbs12(values=swapped))
    assert "by 1 with its bytes the other way round: the DBC has the wrong byte order" in found["order-sequence"]
    assert "by 10 with its bytes" in found["order-tick"]
    assert not {"leaps", "tick-leaps", "lost"} & set(found)


def test_losses_and_leaps_are_counted() -> None:
    heard = listening()
    batch = telemetry(heard.rig, 2500)
    hear(heard, np.delete(batch, [100, 101, 900]), 2.5)
    assert "3 samples are missing in 2 gaps" in texts(heard)["lost"]
    assert "lost 3" in shown(heard)
    heard = of_tsbs12(values=lambda k: {**readings(k), "seq": k + 500 * (k > 1000)})
    assert "the sequence leapt 1 times" in texts(heard)["leaps"]


def test_a_rate_that_is_not_the_dbcs_and_a_tick_that_is_not_the_rig_files() -> None:
    heard = listening()
    slow = telemetry(heard.rig, 2000, lambda k: {**readings(k), "tick": 20 * k}, period_ns=2_000_000)
    found = texts(hear(heard, slow, 4.0))
    assert list(found) == ["rate"]
    assert "telemetry comes 500 times a second without a gap, the DBC says 1000" in found["rate"]
    assert "GenMsgCycleTime" in found["rate"]
    heard = of_tsbs12(4000, 4.0, values=lambda k: {**readings(k), "tick": k})
    found = texts(heard)
    assert list(found) == ["tick"]
    assert "lost ?" in shown(heard)
    assert "a tick takes 0.001 s by this host's clock, the rig file says 0.0001 s" in found["tick"]


def test_another_dbc_is_told_with_both_lists() -> None:
    heard = listening()
    batch = telemetry(heard.rig, 2500)
    batch["id"] = 0x181
    hear(heard, batch, 2.5)
    (only,) = texts(heard).values()
    assert "2500 frames came, none of telemetry: the DBC has 0x100 Telemetry; on the bus are 0x181" in only
    assert "Next: is tsbs12.dbc of this controller" in only
    assert "0x181" in shown(heard)


def test_silence_errors_and_noise_have_their_next_steps() -> None:
    nothing = empty_batch()
    (only,) = texts(hear(listening(), nothing, 2.0)).values()
    assert "nothing comes over slcan:socket://127.0.0.1:28501. Next: is the controller switched on" in only
    assert "(1000 and 5000 kbit/s)" in only
    assert "listen with --acknowledge" in only
    (only,) = texts(hear(listening(manner="open (O)"), nothing, 2.0)).values()
    assert "--acknowledge" not in only
    complaint = "the SLCAN adapter reports bus errors at 500000 bit/s (F80)"
    (only,) = texts(hear(listening(complaint=complaint), nothing, 2.0)).values()
    assert only.startswith(complaint)
    assert "correct bitrate of [links.controller]" in only
    (only,) = texts(hear(listening(), nothing, 2.0, octets=9000, malformed=300)).values()
    assert "9000 bytes came, and no message can be made of them (300 pieces" in only
    errors = joined([frame(0x88, bytes(8), t_ns=START_NS + k * 10**6, flags=ERROR) for k in range(500)])
    (only,) = texts(hear(listening(), errors, 2.0, error_frames=500)).values()
    assert "500 error frames and no other: the bit rate is not the bus's (1000 and 5000 kbit/s)" in only
    assert texts(hear(listening(), nothing, 0.5)) == {}


def test_telemetry_that_ends_is_told() -> None:
    heard = of_tsbs12(1000, 4.0)
    assert "telemetry has not come for 3 s" in texts(heard)["stopped"]
    assert "telemetry  - of 1000/s" in shown(heard)


def test_channels_that_leave_what_they_may_read() -> None:
    def wild(k: int) -> Mapping[str, float]:
        return {**readings(k), "i_m1": -16.384, "i_m2": 13.0, "state": 4, "pos_xo": 200e-6, "supply": 148.0}

    heard = of_tsbs12(values=wild)
    found = texts(heard)
    assert found["ends"].startswith("i_m1 stood at an end of what their signals hold")
    assert found["beyond"].startswith("pos_xo, i_m2 left the envelope")
    assert "i_xi_n" in found["stuck"]
    assert "i_xi_p" not in found["stuck"]
    text = shown(heard)
    assert re.search(r"i_m1 +-16\.38 A +!", text)
    told = summary(heard, troubles(heard), {}, 80)
    assert "at its end" in told
    assert "beyond" in told
    at_rest = of_tsbs12(values=lambda k: {**readings(k), "pos_xo": 200e-6})
    assert texts(at_rest) == {}  # a rotor that is not held may lie anywhere


def test_a_reading_outside_of_the_dbcs_range_and_codes_without_a_name() -> None:
    heard = listening()
    supply = heard.rig.messages["Telemetry"].signal("supply")
    heard.readings.by_name["supply"].scale = Scale.of(dataclasses.replace(supply, low=40.0, high=60.0), code=False)
    hear(heard, telemetry(heard.rig, 2500, lambda k: {**readings(k), "supply": 61.0, "state": 9, "fault": 12}), 2.5)
    found = texts(heard)
    assert "supply read beyond the range that the DBC states" in found["outside"]
    assert "state is 9 (no name in the DBC)" in found["code-state"]
    assert "fault is 12 (no name in the DBC)" in found["code-fault"]


def plainamb(count: int, without: str = "", counter: int = 0) -> FrameBatch:
    """Of the example with five messages a sample; `counter` is added to what each further message counts."""
    rig = listening(str(ROOT / "examples/own-controller/plainamb.toml")).rig
    out = []
    for k in range(count):
        for name in rig.binding.telemetry:
            first = name == "AmbSync"
            values = {"SeqNo": k, "Ticks": 10 * k} if first else {"Rolling": (k + counter) % 16}
            if name == "AmbPos":
                values["XA"] = 10 + k % 3
            if name != without:
                message = rig.messages[name]
                out.append(packed(message.identifier, encode(message, values), t_ns=START_NS + k * 1_000_000))
    return batch_of(out)


def test_a_sample_of_several_messages() -> None:
    heard = hear(listening(str(ROOT / "examples/own-controller/plainamb.toml")), plainamb(2500), 2.5)
    assert texts(heard) == {}
    assert "Standby (OFF)   fault Ok" in shown(heard)
    heard = hear(listening(str(ROOT / "examples/own-controller/plainamb.toml")), plainamb(2500, without="AmbRest"), 2.5)
    found = texts(heard)
    assert "telemetry never had AmbRest (0x093): no sample is whole" in found["part-absent"]
    assert heard.readings.by_name["pos_xi"].moves
    assert "?" in shown(heard)


def test_readings_that_are_no_numbers_are_counted_and_left_out() -> None:
    heard = listening()
    reading = heard.readings.by_name["supply"]
    reading.take(np.array([1.0, np.nan]), held=False)
    reading.take(np.array([np.inf]), held=False)
    assert (reading.count, reading.numberless, reading.low, reading.high) == (3, 2, 1.0, 1.0)
    assert remark(reading) == "no number"


def test_a_rig_file_that_is_not_finished_can_be_listened_with(tmp_path: Path) -> None:
    """Links, the controller's telemetry and channels, and nothing else."""
    example = ROOT / "examples/own-controller"
    text = (example / "plainamb.toml").read_text(encoding="utf-8")
    before, links = text.split("[uut]")[0], text[text.index("[links.controller]") : text.index("[geometry]")]
    links = re.sub(r"(?s)\[devices\.controller\.binding\.commands\].*?\n\n", "", links)
    channels = text[text.index("[channels]") : text.index("[parameters]")]
    bare = tmp_path / "bare.toml"
    bare.write_text(re.sub(r"(?m)^(mass_density|hanger|hook_seat) .*", "", before) + links + channels, encoding="utf-8")
    shutil.copy(example / "plainamb.dbc", tmp_path)
    rig, problems = listenable(str(bare))
    assert problems > 10
    heard = Listened(rig, Ear("controller", rig.link.url, SILENT, START_NS))
    hear(heard, plainamb(2500), 2.5)
    assert texts(heard) == {}
    assert "Standby (OFF)   fault Ok" in shown(heard)
    bare.write_text(bare.read_text().replace("AmbPos.XA", "AmbPos.XQ").replace('"SeqNo"', '"SeqN"'), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        listenable(str(bare))
    assert [p.key for p in caught.value.problems] == ["channels.pos_xi.signal", "devices.controller.binding.sequence"]
