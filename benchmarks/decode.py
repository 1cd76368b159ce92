"""Speed of decoding: batches of 10 000 frames against cantools frame by frame, in one run.

    python benchmarks/decode.py

Prints the ratio for an 8-byte and a 64-byte message, then a JSON line; the targets are 50 and 15.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cantools
import numpy as np

from bench.link.codec import Decoder
from bench.link.frames import FRAME, FrameBatch
from bench.rigfile.messages import load_messages

DBC = Path(__file__).resolve().parent.parent / "rigs" / "tsbs12.dbc"
FRAMES = 10_000
CASES = (("Command", 50.0), ("Telemetry", 15.0))
"""An 8-byte message of four signals and a 64-byte one of 31, and the ratio to reach."""


def batch_of(identifier: int, length: int) -> FrameBatch:
    """Frames of random bytes."""
    batch = np.zeros(FRAMES, FRAME)
    batch["id"], batch["length"] = identifier, length
    batch["data"][:, :length] = np.random.default_rng(1).integers(0, 256, (FRAMES, length))
    return batch


def best(work: Callable[[], object], times: int) -> float:
    """Least processor seconds of several tries."""
    taken = []
    for _ in range(times):
        start = time.process_time()
        work()
        taken.append(time.process_time() - start)
    return min(taken)


def main() -> int:
    """Run and print; 1 when a target is missed."""
    text = DBC.read_text(encoding="utf-8")
    ours = load_messages(text)
    theirs: Any = cantools.database.load_string(text, database_format="dbc")
    out: dict[str, object] = {"frames": FRAMES}
    missed = False
    for name, target in CASES:
        message, reference = ours[name], theirs.get_message_by_name(name)
        batch, decoder = batch_of(message.identifier, message.length), Decoder(message)
        payloads = [bytes(row[: message.length]) for row in batch["data"]]
        values, _ = decoder.decode(batch)
        first = reference.decode(payloads[0], decode_choices=False)
        if any(abs(values[n][0] - v) > np.spacing(abs(float(v))) for n, v in first.items()):
            raise SystemExit(f"{name}: the two decoders disagree; nothing to time")
        mine = best(lambda d=decoder, b=batch: d.decode(b), 20)  # type: ignore[misc]
        per_frame = best(lambda r=reference, p=payloads: [r.decode(x, decode_choices=False) for x in p], 3)  # type: ignore[misc]
        ratio = per_frame / mine
        missed |= ratio < target
        print(f"{name} ({message.length} bytes): {mine * 1e3:.2f} ms against {per_frame * 1e3:.0f} ms, "
              f"{ratio:.0f} times (target {target:.0f})")  # fmt: skip
        out[name] = {"bytes": message.length, "ratio": round(ratio, 1), "target": target}
    print(json.dumps(out))
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
