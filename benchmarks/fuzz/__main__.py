"""Feed damaged inputs to every reader of a file and every codec of a wire.

python -m benchmarks.fuzz [--inputs 1000000] [--seconds S] [--only TEXT] [--seed 1] [--json]

Every input is a whole one of its format with one to three things done to it: bits flipped, cut,
numbers at their edges, deep or endless words put in, two samples spliced, a stretch twice. A reader
may return something or refuse with an error of ours; a codec may not raise at all. Counted are
tracebacks (any other error), results accepted wrong (a ray that is no unit vector, a button the
device has not, a checked frame that nobody sent), and hangs: an input that takes more than
`LIMIT_S` of processor time.
`--seconds` ends a target early; how many inputs it had is printed.
"""

import argparse
import json
import resource
import signal
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.fuzz.codecs import codecs
from benchmarks.fuzz.damage import damaged, draws
from benchmarks.fuzz.files import files
from benchmarks.fuzz.target import Target
from lab.clock import StopWatch

LIMIT_S = 5.0
MEMORY_BYTES = 6 << 30
SHOWN = 3
LOOK_EVERY = 64


class _Hang(BaseException):
    """An input took too long; no reader can swallow it."""


@dataclass(frozen=True)
class Outcome:
    """What a target did; `where` counts tracebacks by their last line of ours."""

    name: str
    inputs: int
    refused: int
    wrong: int
    tracebacks: int
    hangs: int
    seconds: float
    where: dict[str, int]


def _hang(number: int, frame: object) -> None:
    raise _Hang


def fuzz(target: Target, inputs: int, seconds: float, seed: int) -> Outcome:
    """Feed one target; stop after so many inputs or seconds."""
    rng = np.random.default_rng([seed, *target.name.encode()])
    drawn, watch = draws(rng), StopWatch()
    refused = wrong = hangs = done = 0
    where: Counter[str] = Counter()
    signal.signal(signal.SIGVTALRM, _hang)
    while done < inputs and (done % LOOK_EVERY or watch.elapsed_s() < seconds):
        samples = target.samples
        data = damaged(
            samples[next(drawn) % len(samples)], samples[next(drawn) % len(samples)], drawn
        )
        done += 1
        signal.setitimer(signal.ITIMER_VIRTUAL, LIMIT_S)
        try:
            if not target.is_sound(target.read(data)):
                if not wrong:
                    keep(target, data)
                wrong += 1
        except target.refusals:
            refused += 1
        except _Hang:
            hangs += 1
            where["hang"] += 1
        except Exception as error:  # what should never come is counted
            last = traceback.extract_tb(error.__traceback__)[-1]
            place = f"{type(error).__name__} at {Path(last.filename).name}:{last.lineno}"
            if where[place] < 1:
                keep(target, data)
                traceback.print_exc(file=sys.stderr)
            where[place] += 1
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    return Outcome(
        target.name, done, refused, wrong, sum(where.values()) - hangs, hangs,
        round(watch.elapsed_s(), 1), dict(where),
    )  # fmt: skip


def keep(target: Target, data: bytes) -> None:
    """Keep an input that shows something wrong."""
    name = f"fuzz-{target.name.replace(' ', '-')}.bin"
    (Path(tempfile.gettempdir()) / name).write_bytes(data)


def main() -> int:
    """Print a row per target; exit status 1 where anything hung, raised or was wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--inputs", type=int, default=1_000_000)
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--only", default="", help="targets whose name holds this")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    outcomes = []
    with tempfile.TemporaryDirectory() as scratch:
        for target in (*codecs(), *files(Path(scratch))):
            if options.only not in target.name:
                continue
            outcome = fuzz(target, options.inputs, options.seconds, options.seed)
            outcomes.append(outcome)
            if not options.json:
                print(
                    f"{outcome.name:34} {outcome.inputs:9} inputs {outcome.refused:9} refused "
                    f"{outcome.wrong:5} wrong {outcome.tracebacks:6} tracebacks "
                    f"{outcome.hangs:4} hangs "
                    f"{outcome.seconds:7} s",
                    flush=True,
                )
                for place, n in list(outcome.where.items())[:SHOWN]:
                    print(f"    {n} × {place}", flush=True)
    if options.json:
        print(json.dumps([asdict(outcome) for outcome in outcomes]))
    else:
        print(
            f"{len(outcomes)} targets, {sum(o.inputs for o in outcomes)} inputs, "
            f"{sum(o.wrong for o in outcomes)} accepted wrong, "
            f"{sum(o.tracebacks for o in outcomes)} tracebacks, "
            f"{sum(o.hangs for o in outcomes)} hangs"
        )
    return int(any(o.wrong or o.tracebacks or o.hangs for o in outcomes))


if __name__ == "__main__":
    sys.exit(main())
