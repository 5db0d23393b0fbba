"""Show that a synchronisation test recovers what was planted in a simulated room.

    python -m benchmarks.sync_test [--repeats 100] [--frames 1000000] [--json]

The chain is the test's own: textures, simulated headset, armband driver and firmware on their
wire, board with a clock that drifts on its wire. "Error" is measured minus true, of the median
and of the standard deviation; the limit is 0.2 ms. Then damaged frames of the board's codec.
"""

import argparse
import json
import sys

import numpy as np

from visavis.analysis.sync_test import Delays
from visavis.cli.sync_chain import perform_simulated
from visavis.devices.drivers.armband.codec import FrameReader
from visavis.devices.sim.sync_room import PlantedDelay
from visavis.devices.sync.board_codec import (
    BLOCK,
    BoardTime,
    Samples,
    decode,
    encode_samples,
    encode_time,
)
from visavis.lab.errors import LabError

LIMIT_MS = 0.2
PLANTED = (
    (PlantedDelay(3.0, 0.0), PlantedDelay(8.0, 0.0)),
    (PlantedDelay(9.0, 2.0), PlantedDelay(24.0, 6.0)),
    (PlantedDelay(21.0, 4.0, 1.5), PlantedDelay(65.0, 12.0, -2.0)),
)


def errors_ms(found: Delays, true_ms: np.ndarray) -> tuple[float, float]:
    """Return the errors of median and standard deviation."""
    return found.median_ms - float(np.median(true_ms)), found.sd_ms - float(np.std(true_ms, ddof=1))


def fuzz(count: int) -> tuple[int, int]:
    """Damage frames of the board; return how many were taken for others, and how many raised."""
    rng = np.random.default_rng(5)
    reader = FrameReader()
    wrong = raised = 0
    for i in range(count):
        if i % 2:
            levels = rng.integers(0, 256, (BLOCK, 3)).astype(np.uint8)
            intact = encode_samples(Samples(i % 256, i * 37 % 2**32, 250, levels))
        else:
            intact = encode_time(BoardTime(i % 256, i * 91 % 2**32))
        broken = bytearray(intact)
        at = int(rng.integers(len(broken) - 1))
        kind = i // 2 % 4
        if kind == 0:
            broken[at] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            del broken[at]
        elif kind == 2:
            broken.insert(at, int(rng.integers(1, 256)))
        else:
            broken[at : at + 3] = rng.integers(0, 256, 3).astype(np.uint8).tobytes()
            broken[-1] = 0
        if bytes(broken).strip(b"\0") == intact.strip(b"\0"):
            continue
        try:
            taken = [decode(frame) for frame in reader.feed(b"\0" + bytes(broken))]
        except Exception:
            raised += 1
            continue
        wrong += sum(said is not None for said in taken)
    return wrong, raised


def main() -> None:
    """Print the table, or JSON; exit 1 when a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=100)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    rows: list[tuple[str, float, str, float | None]] = []
    try:
        for number, (picture, sound) in enumerate(PLANTED, start=1):
            found, _, _, true_ms = perform_simulated(
                seed=number, repeats=arguments.repeats, picture=picture, sound=sound, rise_ms=0.0
            )
            for one in found:
                median, sd = errors_ms(one, true_ms[one.modality])
                name = f"{one.modality} of chain {number}"
                rows.append((f"{name}: measured median", one.median_ms, "ms", None))
                rows.append((f"{name}: measured jitter (SD)", one.sd_ms, "ms", None))
                rows.append((f"{name}: error of the median", median, "ms", LIMIT_MS))
                rows.append((f"{name}: error of the jitter", sd, "ms", LIMIT_MS))
    except LabError as problem:
        print(f"not measured: {problem}", file=sys.stderr)
        sys.exit(1)
    wrong, raised = fuzz(arguments.frames)
    rows.append((f"board: wrong of {arguments.frames} damaged frames", wrong, "frames", 0.0))
    rows.append((f"board: raised by {arguments.frames} damaged frames", raised, "frames", 0.0))
    if arguments.json:
        keys = ("name", "value", "unit", "limit")
        print(json.dumps([dict(zip(keys, row, strict=True)) for row in rows]))
    else:
        for name, value, unit, limit in rows:
            told = "" if limit is None else f"limit {limit:g}"
            print(f"{name:50} {value:10.3f} {unit:7} {told}")
    missed = [row for row in rows if row[3] is not None and abs(row[1]) > row[3]]
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
