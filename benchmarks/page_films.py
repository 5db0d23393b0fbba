"""Build the twelve films of the study interpolation, and one again: what does a frame cost?

    python -m benchmarks.page_films [--json]

Twelve films of 720 x 720 pixels at 60 pictures a second, drawn and encoded in one process. Prints
CPU seconds, and whether the film built again is the same to the byte; exits 1 where it is not.
"""

import argparse
import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from visavis.lab.clock import StopWatch, cpu_time_s
from visavis.protocol.plan.experiment import no_progress
from visavis.results.opened_study import find_study
from visavis.running.film_store import film_store


def main() -> int:
    """Build them and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    experiment = find_study("interpolation").experiment({})
    films = experiment.films
    with tempfile.TemporaryDirectory() as first, tempfile.TemporaryDirectory() as second:
        store = replace(film_store(experiment), folder=Path(first))
        watch, before_s = StopWatch(), cpu_time_s()
        store.build(films, no_progress)
        cpu_s, wall_s = cpu_time_s() - before_s, watch.elapsed_s()
        built = store.file_of(films[0])
        again = replace(store, folder=Path(second))
        again.build(films[:1], no_progress)
        rebuilt = again.file_of(films[0])
        assert built is not None
        assert rebuilt is not None
        size = sum(f.size_bytes for film in films if (f := store.file_of(film)) is not None)
        is_equal = built.sha256 == rebuilt.sha256
    frames = sum(film.frame_count for film in films)
    told = {
        "films": len(films),
        "frames": frames,
        "cpu_s": round(cpu_s, 1),
        "wall_s": round(wall_s, 1),
        "cpu_ms_a_frame": round(1000 * cpu_s / frames, 1),
        "megabytes": round(size / 1e6, 1),
        "same_when_rebuilt": is_equal,
    }
    sys.stdout.write(
        json.dumps(told) + "\n"
        if options.json
        else "\n".join(f"{name:20} {value}" for name, value in told.items()) + "\n"
    )
    return 0 if is_equal else 1


if __name__ == "__main__":
    raise SystemExit(main())
