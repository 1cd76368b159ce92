"""What a rig can do wrong, and what a run must end in. docs/reference/faults.md is made of it:

python tests/firmware/misbehaviours.py > docs/reference/faults.md
"""

from __future__ import annotations

from dataclasses import dataclass

PASS, INDETERMINATE, ERROR, ABORTED, NO_RUN = "PASS", "INDETERMINATE", "ERROR", "ABORTED", "no run"
STATUS = {PASS: {0}, INDETERMINATE: {5}, ERROR: {3}, ABORTED: {4}, NO_RUN: {2, 3}}
NOISE = frozenset(
    {
        "parameters-restored",
        "telemetry-late",
        "heartbeat-late",
        "heartbeat-unprioritised",
        "clock-unknown",
        "step-incomplete",
        "loads-scatter",
    }
)
"""Findings of a busy machine, that one sound set of loads in twenty has, or that say no more than another one."""


@dataclass(frozen=True)
class Kind:
    """A misbehaviour: its name, its switches, the outcome, the findings that the record must have (or, without a run, what the
    terminal must say), what it is."""

    name: str
    switches: str
    outcome: str
    findings: tuple[str, ...]
    about: str
    says: str = ""
    wire: str = "packets"
    long: bool = False
    also: tuple[str, ...] = ()
    """Findings that may come as well, as chance has it."""


LOST = ("samples-lost", "missing-samples")
CRC = ("packets-corrupt", "packets-lost", *LOST)
HARMLESS = (
    Kind("sound", "", PASS, (), "nothing is wrong, packets", long=True),
    Kind("sound-slcan", "", PASS, (), "nothing is wrong, SLCAN", wire="slcan"),
    Kind("duplicates", "dup=0.01", PASS, ("frames-duplicated",), "1 telemetry in 100 comes twice", long=True),
    Kind("reordering", "reorder=0.01", PASS, ("frames-reordered",), "1 telemetry in 100 comes after the next one"),
    Kind("drift-inside", "ppm=150", PASS, (), "the controller's clock runs 150 ppm fast"),
    Kind("bundles", "bundle=5", PASS, (), "5 ms of telemetry in a packet"),
    Kind("dribble", "dribble", PASS, (), "bytes come seven at a time"),
    Kind(
        "prefix", "prefix=300000", PASS, ("bytes-malformed",), "300 kB of noise at the start", also=("packets-corrupt",)
    ),
    Kind("pause", "pause=0.3@1", PASS, (), "0.3 s of telemetry come late"),
    Kind("packet-numbers-jump", "packetseqjump=300@1", PASS, ("packets-lost",), "the packets' number leaps by 300"),
    Kind("noise-between", "huge2k=0.01@1", PASS, ("bytes-malformed",), "2 kB of noise behind 1 packet in 100"),
    Kind("strangers", "unknown=0.05", PASS, ("unknown-frames",), "messages that the DBC does not know"),
    Kind("double-replies", "dupreply", PASS, (), "every reply comes twice"),
    Kind("lost-replies", "lostreply=10", PASS, ("requests-repeated",), "each tenth reply is lost", long=True),
    Kind("lost-levitate", "lostlevitate", PASS, ("requests-repeated",), "LEVITATE is executed, its reply lost"),
    Kind(
        "forgetful",
        "lostlevitate forgetful",
        PASS,
        ("requests-repeated",),
        "the same, and the repeat is refused: WRONG_STATE",
    ),
    Kind("slow-replies", "slowreply=0.45", PASS, ("link-slow",), "replies take 0.45 s"),
    Kind("late-replies", "slowreply=1.2", PASS, ("requests-repeated",), "replies take longer than they are waited for"),
    Kind("odd-reply-state", "cmdstate=99", PASS, (), "CommandReply tells a state that the DBC does not name"),
    Kind("serial-0", "serial0", PASS, ("simulated-controller",), "serial number 0: a simulated controller"),
    Kind("no-status", "noF", PASS, (), "the adapter does not answer F", wire="slcan"),
    Kind("slow-fieldbus", "mbslow=0.3@1", PASS, (), "the fieldbus answers after 0.3 s"),
    Kind("dropped-fieldbus", "mbdrop=1@1", PASS, ("link-reconnected",), "the fieldbus hangs up once"),
    Kind("dropped-fieldbus-3", "mbdrop=3@1", PASS, ("link-reconnected",), "the fieldbus hangs up three times"),
)
SPOILED = (
    Kind("crc", "crc=0.003", INDETERMINATE, CRC, "3 packets in 1000 have a wrong CRC", also=("requests-repeated",)),
    Kind(
        "flipped-bits",
        "flip=0.004",
        INDETERMINATE,
        LOST,
        "4 packets in 1000 have a bit flipped",
        also=("packets-corrupt", "packets-lost", "bytes-malformed", "requests-repeated"),
    ),
    Kind("drops", "drop=0.003", INDETERMINATE, LOST, "3 telemetries in 1000 are missing"),
    Kind(
        "bad-lines",
        "badline=0.01",
        INDETERMINATE,
        ("bytes-malformed", *LOST),
        "1 SLCAN line in 100 is none",
        wire="slcan",
        also=("requests-repeated",),
    ),
    Kind(
        "other-version",
        "badversion=0.01@1",
        INDETERMINATE,
        LOST,
        "1 packet in 100 has another version",
        also=("bytes-malformed", "packets-corrupt", "packets-lost", "requests-repeated"),
    ),
    Kind(
        "wrong-length",
        "wronglength=0.003",
        INDETERMINATE,
        ("wrong-length",),
        "3 telemetries in 1000 are short",
        also=LOST,
    ),
    Kind(
        "flood",
        "huge=2000000@1",
        f"{PASS} or {INDETERMINATE}",
        ("bytes-malformed",),
        "2 MB of noise at once",
        also=("packets-lost", *LOST, "requests-repeated"),
    ),
    Kind("drift", "ppm=400", INDETERMINATE, ("clock-drift",), "the controller's clock runs 400 ppm fast"),
    Kind(
        "drift-slow",
        "ppm=-400",
        INDETERMINATE,
        ("clock-drift",),
        "the controller's clock runs 400 ppm slow",
        wire="slcan",
    ),
    Kind("drift-far", "ppm=5000", ERROR, ("clock-drift",), "the controller's clock is off by half a percent"),
    Kind("drift-absurd", "ppm=-20000", ERROR, ("clock-drift",), "the controller's clock is slow by two percent"),
    Kind(
        "drift-fast", "ppm=20000", ERROR, ("clock-drift",), "the controller's clock is fast by two percent", long=True
    ),
    Kind("clock-half", "ppm=-500000", ERROR, ("clock-drift",), "the controller's clock runs at half the rate"),
    Kind("clock-double", "ppm=1000000", ERROR, ("clock-drift",), "the controller's clock runs at twice the rate"),
)
COUNTERS = (
    Kind(
        "sequence-leaps", "seqjump=5000@1", PASS, ("sequence-leapt",), "the sequence leaps by 5000, the tick does not"
    ),
    Kind("sequence-leaps-3", "seqjump=3@1", PASS, ("sequence-leapt",), "the sequence leaps by 3, the tick does not"),
    Kind(
        "tick-leaps", "tickjump=30@1", INDETERMINATE, ("tick-leapt",), "the tick leaps by 3 ms, the sequence does not"
    ),
    Kind("tick-leaps-far", "tickjump=100000@1", INDETERMINATE, ("tick-leapt",), "the tick leaps by 10 s"),
    Kind("tick-goes-back", "tickback=5000@1", INDETERMINATE, ("tick-leapt",), "the tick goes back by 0.5 s"),
    Kind(
        "tick-goes-back-far",
        "tickback=30000@1",
        ABORTED,
        ("controller-fault", "controller-restarted"),
        "the tick goes back by 3 s",
    ),
    Kind("tick-frozen", "tickfrozen@1", ERROR, ("telemetry-frozen",), "frames come, the tick stands", long=True),
    Kind("sequence-frozen", "seqfrozen@1", ERROR, ("telemetry-frozen",), "frames come, the sequence stands"),
    Kind("restart", "reset@1", ABORTED, ("controller-fault", "controller-restarted"), "the controller begins anew"),
)
READINGS = (
    Kind("stuck-current", "stuck_yo_p@1", ERROR, ("stuck-channel",), "one coil current stands still"),
    Kind("stuck-position", "stuck_pos_yo@1", ERROR, ("stuck-channel",), "one position stands still"),
    Kind("all-stuck", "all_stuck@1", ERROR, ("stuck-channel",), "tick and sequence run, all readings stand"),
    Kind("extremes", "extreme=0.01@1", ABORTED, ("interlock",), "1 telemetry in 100 is at the ends of its ranges"),
    Kind("far-position", "posextreme=0.0003@1", ABORTED, ("interlock",), "a position of 0.65 mm now and then"),
    Kind("far-current", "currentneg=0.001@1", ABORTED, ("interlock",), "a current of -16 A now and then"),
    Kind("hot-telemetry", "hotwinding=400@1", ABORTED, ("interlock",), "telemetry says 400 K of a winding"),
    Kind("glitches", "glitch_i=0.004@1", ERROR, ("load-inconsistent",), "a current of 0 A now and then"),
    Kind("gain", "gain_yo_p=1.1@8", INDETERMINATE, ("outlier",), "a current sensor reads 10 % more from then on"),
    Kind("wrong-mass", "wrongmass=1.02", ERROR, ("load-inconsistent",), "M2 weighs 2 % more", long=True),
    Kind("contact", "badflags=12@1", INDETERMINATE, ("contact",), "flags say that the shaft touches its rings"),
    Kind("all-flags", "badflags=65535@1", INDETERMINATE, ("contact",), "every flag is set"),
    Kind(
        "unknown-state",
        "badstate=42@1",
        ABORTED,
        ("controller-fault",),
        "a state that the DBC does not name",
        long=True,
    ),
    Kind("says-off", "badstate=0@1", ERROR, ("state-contradicts",), "telemetry says OFF of a rotor that is held"),
    Kind("says-ready", "badstate=1@1", ERROR, ("state-contradicts",), "telemetry says READY of a rotor that is held"),
    Kind("late-fault", "latefault=5", ERROR, ("controller-fault",), "levitation is lost while the rotor is landed"),
    Kind("unknown-fault", "badfault=77@1", ABORTED, ("controller-fault",), "a fault that the DBC does not name"),
)
SILENCE = (
    Kind("half-open", "halfopen@1", ERROR, ("link-lost",), "nothing comes any more, the connection stands"),
    Kind("half-open-slcan", "halfopen@1", ERROR, ("link-lost",), "the same on SLCAN", wire="slcan"),
    Kind("half-closed", "halfclose@1", ERROR, ("link-lost",), "the controller closes its direction"),
    Kind("closed", "fin@1", ERROR, ("link-lost",), "the connection is closed", wire="slcan", long=True),
    Kind("reset-connection", "rst@1", ERROR, ("link-lost",), "the connection is reset", wire="slcan"),
    Kind("no-telemetry", "notelemetry@1", ERROR, ("link-lost",), "telemetry ends, replies come", long=True),
    Kind("noise", "garbage=200@1", ERROR, ("bytes-unreadable",), "200 kB/s of noise in place of everything", long=True),
    Kind("slow-bytes", "slowloris=10@1", ERROR, ("bytes-unreadable",), "10 bytes a second"),
    Kind("slow-bytes-slcan", "slowloris=10@1", ERROR, ("bytes-unreadable",), "the same on SLCAN", wire="slcan"),
    Kind(
        "bus-off",
        "statusF=128@1 pause=2@2",
        ERROR,
        ("bus-off",),
        "the adapter tells bus errors, and nothing comes",
        wire="slcan",
    ),
    Kind("deaf-to-heartbeats", "deafheart@1", ABORTED, ("controller-fault",), "heartbeats are not heard"),
    Kind(
        "second-host",
        "hostspoof=0.01@1",
        ABORTED,
        ("another-host",),
        "heartbeats of another host come in",
        wire="slcan",
    ),
)
ANSWERS = (
    Kind("mute", "mute@1", ERROR, ("no-reply",), "requests are not answered any more", long=True),
    Kind("command-token", "cmdtoken", ERROR, ("no-reply",), "CommandReply has another token"),
    Kind("command-status", "cmdstatus=9", ERROR, ("controller-refused",), "CommandReply has status 9"),
    Kind("parameter-status", "badstatus=200", ERROR, ("controller-refused",), "ParamReply has status 200"),
    Kind(
        "does-not-enable",
        "disobey=1",
        ERROR,
        ("state-not-reached",),
        "ENABLE is answered, and nothing happens",
        long=True,
    ),
    Kind("does-not-levitate", "disobey=2", ERROR, ("state-not-reached",), "LEVITATE is answered, and nothing happens"),
    Kind("does-not-turn", "stuckangle", ERROR, ("rotor-not-arrived",), "the rotor does not turn", long=True),
    Kind("operator-silent", "deafoperator@1", ERROR, ("operator-silent",), "the operator does not answer"),
    Kind("operator-empty", "answer-empty", ERROR, ("operator-refused",), "the operator answers an empty line"),
    Kind("operator-refuses", "answer-error", ERROR, ("operator-refused",), "the operator answers `error`"),
    Kind("operator-gone", "answer-gone@1", ERROR, ("link-lost",), "the operator's line closes"),
)
FIELDBUS = (
    Kind("drive-refuses", "mbexception=4@1", ERROR, ("device-refused",), "every request gets exception 4"),
    Kind("fieldbus-gone", "mbdrop=1000@1", ERROR, ("link-lost",), "the fieldbus hangs up again and again"),
    Kind("no-number", "mbnan@1", ERROR, ("device-unreadable",), "the thermal monitor says NaN"),
    Kind("drive-fault", "mbfault=2@1", ABORTED, ("drive-fault",), "the drive reports a fault"),
    Kind("hot-winding", "mbhot@1", ABORTED, ("interlock",), "the thermal monitor says 200 degC", long=True),
    Kind("supply-off", "mbsupplyoff@1", ABORTED, ("interlock",), "the supply says 0 V and off"),
)
AT_START = (
    Kind("silent", "silent", NO_RUN, (), "nothing comes", "no telemetry within 1.5 s. Is the controller on"),
    Kind("deaf-and-dumb", "halfopen", NO_RUN, (), "a connection, and nothing else", "no telemetry within 1.5 s"),
    Kind("noise-at-start", "garbage=200", NO_RUN, (), "200 kB/s of noise", r"\d+ bytes came in .* kB/s\), but no message can"),
    Kind("noise-on-slcan", "garbage=200", NO_RUN, (), "the same where an adapter is expected",
         "pieces came that are no SLCAN|bytes came .* no message can be made",
         wire="slcan"),
    Kind("slow-bytes-at-start", "slowloris=10", NO_RUN, (), "10 bytes a second", r"bytes came .* no message can be made"),
    Kind("no-claim", "noclaim", NO_RUN, (), "Claim is not answered", "the answer to Claim; it did not come, though .* 3 times"),
    Kind("no-identity", "nocommand", NO_RUN, (), "IDENTIFY is not answered", "Identity; it did not come, though .* 3 times"),
    Kind("no-reading", "noparamget", NO_RUN, (), "ParamGet is not answered", "replies to ParamGet; it did not"),
    Kind("no-writing", "noparamset", NO_RUN, (), "ParamSet is not answered", "reply to watchdog_s; it did not come, though"),
    Kind("parameter-token", "wrongtoken", NO_RUN, (), "ParamReply has other tokens", r"ParamReply with token \d+ came; exp"),
    Kind("parameter-nan", "nanreply", NO_RUN, (), "ParamReply has NaN", "the controller reads back nan"),
    Kind("parameter-other", "wrongvalue", NO_RUN, (), "ParamReply has another value", "the controller reads back 3.0"),
    Kind("other-owner", "otherowner", NO_RUN, (), "another host owns it", "in use: its controller obeys nobody@else"),
    Kind("odd-owner", "badname", NO_RUN, (), "another host, its name no text", "in use: its controller obeys"),
    Kind("other-map", "wrongmap", NO_RUN, (), "another message map", "map_version 3.*expected 2"),
    Kind("other-protocol", "wrongproto", NO_RUN, (), "another protocol", "protocol 2.*expected 1"),
    Kind("slow-fieldbus-at-start", "mbslow=5", NO_RUN, (), "the fieldbus answers after 5 s", "no usable answer"),
    Kind("refusing-fieldbus", "mbexception=11", NO_RUN, (), "a gateway without its device", "exception 11"),
    Kind("no-number-at-start", "mbnan", NO_RUN, (), "the thermal monitor says NaN", "hold no finite number"),
)  # fmt: skip
GROUPS = {
    "Harmless": HARMLESS, "Bytes and samples": SPOILED, "Counters": COUNTERS, "Readings": READINGS, "Links": SILENCE,
    "Answers": ANSWERS, "Fieldbus": FIELDBUS, "Before a run": AT_START,
}  # fmt: skip
KINDS = tuple(kind for kinds in GROUPS.values() for kind in kinds)
HEAD = """# What a misbehaving rig ends in

What a run must end in when its controller, its operator or its fieldbus does something wrong. `make faults` lets
`amb-calibration` loose on each of these rigs: the C controller of `tests/firmware` with its mischief, over TCP, with an
operator who hangs masses in it. The page is made of `tests/firmware/misbehaviours.py`
(`python tests/firmware/misbehaviours.py > docs/reference/faults.md`), and a test keeps it so.

- What is harmless passes, with its counts where the link counts it; nothing else passes.
- Every run ends with its finding by its name ([record](record.md#findings)), and no wait is longer than 30 s without a word
  on the terminal.
- *No run*: nothing was started, status 2 or 3; the text is on the terminal.

In the switches `KIND=VALUE@START`, START is in seconds after the rotor was first levitated; without it they act from
power-on. Faults that the bench itself can put into a link or a simulated controller are on
[another page](../how-to/inject-faults.md).
"""


def page() -> str:
    """docs/reference/faults.md."""
    out = [HEAD]
    for name, kinds in GROUPS.items():
        out += [f"\n## {name}\n", "| what | switches | outcome | findings, or text |", "|---|---|---|---|"]
        for k in kinds:
            told = ", ".join(f"`{code}`" for code in k.findings) or (f"*{_plain(k.says)}*" if k.says else "–")
            switches = f"`{k.switches}`" if k.switches else "–"
            out.append(f"| {k.about} | {switches} | {k.outcome} | {told} |")
    return "\n".join(out) + "\n"


def _plain(pattern: str) -> str:
    return pattern.replace(r"\d+", "N").replace(".*", "…").replace(r"\)", ")")


if __name__ == "__main__":
    print(page(), end="")  # noqa: T201
