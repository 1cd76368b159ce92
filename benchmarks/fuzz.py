"""Random bytes, mutated streams and random splits against every wire decoder, each checked by an oracle of its own.

    python -m benchmarks.fuzz [--inputs N] [--seed N] [--only NAME]

An input is what stands between two delimiters (SLCAN, serial packets), one frame (ISO-TP) or one value (registers);
N is for each decoder. Checked: no exception, no hang, bounded memory, exactly the frames that the oracle finds (none
that fails its CRC, none of an impossible length), and the same frames and counts for any split of the bytes. Prints a
line for each decoder, then a JSON line; exit status 1 when there are findings. A finding names its seed and block.
"""

from __future__ import annotations

import argparse
import faulthandler
import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from benchmarks.fuzz_targets import TARGETS

HANG_S = 120.0
"""A block takes well under a second; one that takes this long hangs, and its traceback is printed."""
GROWTH_MIB = 64.0
"""What the process may grow by after the first blocks of a decoder."""
WARM_UP = 12
"""Blocks before memory is watched: caches and pools fill in the first ones."""
MOST_FINDINGS = 20


@dataclass
class Result:
    """What happened to one decoder."""

    inputs: int = 0
    blocks: int = 0
    frames: int = 0  # accepted ones: a fuzz target that never gets through the door tests only the door
    seconds: float = 0.0
    findings: list[str] = field(default_factory=list)


def fuzz(
    name: str,
    inputs: int,
    *,
    seed: int = 0,
    most: int = MOST_FINDINGS,
    watch: Callable[[], object] = lambda: None,
) -> Result:
    """Blocks of inputs until there are enough of them, or too many findings.

    Args:
        name: one of TARGETS.
        inputs: at least so many.
        seed: blocks are drawn from (seed, target, block): a finding can be repeated alone.
        most: findings after which there is no point in going on.
        watch: called before each block.
    """
    result, start, memory = Result(), time.perf_counter(), 0.0
    while result.inputs < inputs and len(result.findings) < most:
        watch()
        draw = np.random.default_rng([seed, sorted(TARGETS).index(name), result.blocks])
        try:
            count, frames, findings = TARGETS[name](draw)
        except Exception as error:  # the one finding that needs no oracle
            count, frames, findings = 1, 0, [f"raised {error!r}"]
        result.findings += [f"{name}: seed {seed}, block {result.blocks}: {text}" for text in findings]
        result.inputs, result.frames, result.blocks = result.inputs + count, result.frames + frames, result.blocks + 1
        if result.blocks == WARM_UP:
            memory = resident_mib()
        elif result.blocks > WARM_UP and (grown := resident_mib() - memory) > GROWTH_MIB:
            result.findings.append(f"{name}: seed {seed}, block {result.blocks}: grew by {grown:.0f} MiB")
            break
    result.seconds = time.perf_counter() - start
    return result


def resident_mib() -> float:
    """Peak resident memory; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1 << 20 if sys.platform == "darwin" else 1 << 10)


def main() -> int:
    """Run and print; 1 when there are findings."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--inputs", type=int, default=10_000_000, help="for each decoder")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=sorted(TARGETS))
    options = parser.parse_args()
    out: dict[str, object] = {"seed": options.seed}
    found = False
    for name in [options.only] if options.only else TARGETS:
        result = fuzz(
            name, options.inputs, seed=options.seed, watch=lambda: faulthandler.dump_traceback_later(HANG_S, exit=True)
        )
        faulthandler.cancel_dump_traceback_later()
        print(f"{name}: {result.inputs} inputs, {result.frames} accepted, {result.seconds:.1f} s, "
              f"{len(result.findings)} findings")  # fmt: skip
        print("".join(f"  {text}\n" for text in result.findings), end="")
        out[name] = {"inputs": result.inputs, "accepted": result.frames, "seconds": round(result.seconds, 1),
                     "findings": len(result.findings)}  # fmt: skip
        found |= bool(result.findings)
    print(json.dumps(out))
    return int(found)


if __name__ == "__main__":
    sys.exit(main())
