"""Feed damaged inputs to every reader of a file and every codec of a wire.

python -m benchmarks.fuzz [--inputs 1000000] [--seconds S] [--only TEXT] [--seed 1] [--json]

Every input is a whole one of its format with one to three things done to it: bits flipped, cut,
numbers at their edges, deep or endless words put in, two samples spliced, a stretch twice. Of files
with checksums a target more ("sealed again") has values changed and the checksums made anew. A
reader may return something or refuse with an error of ours; a codec may not raise at all. Counted
are tracebacks (any other error), results accepted wrong (a ray that is no unit vector, a button the
device has not, a checked frame that nobody sent), and hangs: an input that takes more than
`LIMIT_S` of processor time.
`--seconds` ends a target early; how many inputs it had is printed. An import of a whole person does
far more than read: its reader gets all inputs, the rest of it a hundredth of them. Files are
written to memory where the system has such a place. With `--tally FILE` counts are kept and each
run goes on where the last one stopped, with other inputs, until every target has had its inputs.
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
from benchmarks.fuzz.damage import draws
from benchmarks.fuzz.files import files
from benchmarks.fuzz.target import Target
from lab.clock import StopWatch

LIMIT_S = 5.0
MEMORY_BYTES = 6 << 30
COUNTS = ("inputs", "refused", "wrong", "tracebacks", "hangs")
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


def fuzz(target: Target, inputs: int, seconds: float, seed: int, begun: int = 0) -> Outcome:
    """Feed one target; stop after so many inputs or seconds.

    `begun` is how many inputs it had with this seed before; it gets others than those.
    """
    rng = np.random.default_rng([seed, *target.name.encode(), *([begun] if begun else [])])
    drawn, watch = draws(rng), StopWatch()
    refused = wrong = hangs = done = 0
    where: Counter[str] = Counter()
    signal.signal(signal.SIGVTALRM, _hang)
    while done < inputs and (done % LOOK_EVERY or watch.elapsed_s() < seconds):
        samples = target.samples
        data = target.change(
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
        target.name,
        done,
        refused,
        wrong,
        sum(where.values()) - hangs,
        hangs,
        round(watch.elapsed_s(), 1),
        dict(where),
    )


def scratch_folder() -> str | None:
    """Return where files lie in memory; None where the system has no such place."""
    return "/dev/shm" if Path("/dev/shm").is_dir() else None  # noqa: S108  # a folder of its own there


def tallied(path: Path | None, seed: int) -> dict[str, dict[str, int]]:
    """Return what each target had so far with a seed: counts by name of `COUNTS`."""
    if path is None or not path.exists():
        return {}
    found: dict[str, dict[str, int]] = json.loads(path.read_text("utf-8")).get(str(seed), {})
    return found


def tally(path: Path, seed: int, counts: dict[str, dict[str, int]]) -> None:
    """Keep counts of a seed beside those of others."""
    every = json.loads(path.read_text("utf-8")) if path.exists() else {}
    new = path.with_name(f"{path.name}.new")
    new.write_text(json.dumps({**every, str(seed): counts}, indent=1), "utf-8")
    new.replace(path)


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
    parser.add_argument("--tally", type=Path, help="keep counts per target here, and go on")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    outcomes = []
    wanted = {}
    counts = tallied(options.tally, options.seed)
    with tempfile.TemporaryDirectory(dir=scratch_folder()) as scratch:
        for target in (*codecs(), *files(Path(scratch))):
            had = counts.get(target.name, dict.fromkeys(COUNTS, 0))
            wanted[target.name] = round(options.inputs * target.share_01)
            left = wanted[target.name] - had["inputs"]
            if options.only not in target.name or left <= 0:
                continue
            outcome = fuzz(target, left, options.seconds, options.seed, had["inputs"])
            outcomes.append(outcome)
            if options.tally is not None:
                counts[target.name] = {name: n + getattr(outcome, name) for name, n in had.items()}
                tally(options.tally, options.seed, counts)
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
    if options.tally is not None and not options.json:
        done = sum(counts.get(name, {"inputs": 0})["inputs"] >= n for name, n in wanted.items())
        print(
            f"in all {sum(had['inputs'] for had in counts.values())} inputs; "
            f"{done} of {len(wanted)} targets had all of theirs"
        )
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
