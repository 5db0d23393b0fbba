"""Feed damaged inputs to every reader of a file, codec of a wire and endpoint of a server.

python -m benchmarks.fuzz [--inputs 1000000] [--seconds S] [--only TEXT] [--seed 1] [--json]

Every input is a whole one of its format with one to three things done to it: bits flipped, cut,
numbers at their edges, deep or endless words put in, two samples spliced, a stretch twice. Of files
with checksums a target more ("sealed again") has values changed and the checksums made anew. A
reader may return something or refuse with an error of ours; a codec may not raise at all. Counted
are tracebacks (any other error), results accepted wrong (a ray that is not a unit vector, a button
the device has not, a checked frame that nobody sent), and hangs: an input that takes more than
`LIMIT_S` of processor time. A checksum of n bits lets one damaged frame of 2ⁿ pass by chance: the
table says beside what was accepted wrong how many may be, and more are a failure.
`--seconds` ends a target early; how many inputs it had is printed. An import of a whole person does
far more than read: its reader gets all inputs, the rest of it a hundredth of them; endpoints, which
record, and whole GET requests to the servers of pages and desk get a tenth. Files are written to
memory where the system has such a place. With `--tally FILE` counts are kept and each run goes on
where the last one stopped, with other inputs, until every target has had its inputs; what each had
in all is printed last (`--inputs 0`: nothing else).
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
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.fuzz.codecs import codecs
from benchmarks.fuzz.damage import draws
from benchmarks.fuzz.endpoints import endpoints
from benchmarks.fuzz.files import files
from benchmarks.fuzz.routes import routes
from benchmarks.fuzz.target import Target, may_pass
from visavis.lab.clock import StopWatch

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
    may_pass: int
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
        may_pass(target.checksum_bits, done),
        sum(where.values()) - hangs,
        hangs,
        round(watch.elapsed_s(), 1),
        dict(where),
    )


def read_whole(target: Target) -> None:
    """Read the whole samples of a target, which it must take; what it compiles, it compiles now.

    Raises:
        ValueError: it refuses one, so that nothing behind the refusal would be reached.
    """
    for sample in target.samples:
        try:
            is_sound = target.is_sound(target.read(sample))
        except target.refusals as error:
            raise ValueError(f"{target.name} refuses a whole sample: {error}") from error
        if not is_sound:
            raise ValueError(f"{target.name}: what it reads in a whole sample is called wrong")


def row(name: str, counts: Mapping[str, int], checksum_bits: int) -> str:
    """Return a row of the table: what a target did with its inputs."""
    may = may_pass(checksum_bits, counts["inputs"])
    return (
        f"{name:50} {counts['inputs']:9} inputs {counts['refused']:9} refused "
        f"{counts['wrong']:5} wrong (may {may:2}) {counts['tracebacks']:6} tracebacks "
        f"{counts['hangs']:4} hangs"
    )


def is_passed(counts: Mapping[str, int], checksum_bits: int) -> bool:
    """Tell whether nothing hung or raised, and no more was wrong than its checksum lets pass."""
    may = may_pass(checksum_bits, counts["inputs"])
    return not counts["tracebacks"] and not counts["hangs"] and counts["wrong"] <= may


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
    counts = tallied(options.tally, options.seed)
    with tempfile.TemporaryDirectory(dir=scratch_folder()) as scratch, ExitStack() as stack:
        posts = stack.enter_context(endpoints(Path(scratch)))
        gets = stack.enter_context(routes(Path(scratch) / "routes"))
        targets = (*codecs(), *files(Path(scratch)), *posts, *gets)
        wanted = {target.name: round(options.inputs * target.share_01) for target in targets}
        bits = {target.name: target.checksum_bits for target in targets}
        for target in targets:
            had = counts.get(target.name, dict.fromkeys(COUNTS, 0))
            left = wanted[target.name] - had["inputs"]
            if options.only not in target.name or left <= 0:
                continue
            read_whole(target)
            outcome = fuzz(target, left, options.seconds, options.seed, had["inputs"])
            outcomes.append(outcome)
            counts[target.name] = {name: n + getattr(outcome, name) for name, n in had.items()}
            if options.tally is not None:
                tally(options.tally, options.seed, counts)
            if not options.json:
                done = {name: getattr(outcome, name) for name in COUNTS}
                print(row(outcome.name, done, target.checksum_bits), outcome.seconds, "s")
                for place, n in list(outcome.where.items())[:SHOWN]:
                    print(f"    {n} × {place}")
                sys.stdout.flush()
    if options.json:
        print(json.dumps([asdict(outcome) for outcome in outcomes]))
        return int(not all(is_passed(counts[o.name], bits[o.name]) for o in outcomes))
    if options.tally is not None:
        print(f"In all, with seed {options.seed}:")
        for name in (name for name in wanted if name in counts):
            print(row(name, counts[name], bits[name]))
        whole = sum(counts.get(name, {"inputs": 0})["inputs"] >= n for name, n in wanted.items())
        print(f"{whole} of {len(wanted)} targets had all of their inputs")
    fed = {name: counts[name] for name in wanted if name in counts}
    print(
        f"{len(fed)} targets, "
        + ", ".join(f"{sum(had[name] for had in fed.values())} {name}" for name in COUNTS)
    )
    return int(not all(is_passed(had, bits[name]) for name, had in fed.items()))


if __name__ == "__main__":
    sys.exit(main())
