"""All figures of speaking bodies and of both studies of them, each beside its limit.

    python -m benchmarks.gestures [--studies N] [--films N] [--json]

Those of `benchmarks.speaking_body` (SIMULATED speaker) and `benchmarks.speaking_viewers` (SIMULATED
people), and of the films of the study gestures: CPU seconds of all that differ (limit 240), from
those of `--films` that are drawn (at least one), and how far the sound of the first is from its
pictures (limit one picture, 33 ms), as `benchmarks.heard_film` finds it. Exits with 1 where a limit
is missed.
"""

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from benchmarks.heard_film import MIN_ALIKE
from benchmarks.heard_film import measure as heard
from benchmarks.speaking_body import measured
from benchmarks.speaking_viewers import simulated
from benchmarks.table import Row, show
from visavis.experiments.gestures import published
from visavis.experiments.gestures.clips import FILLS, PARTS, RATE_HZ, VERSIONS
from visavis.experiments.gestures.study import film_of, study
from visavis.lab.clock import cpu_time_s
from visavis.protocol.plan.experiment import no_progress
from visavis.results.opened_study import OpenedStudy
from visavis.running.film_store import film_store

MAX_FILMS_S = 240.0


def film_rows(count: int) -> list[Row]:
    """Draw so many films of the study with their sound, and return what they cost."""
    films = list(
        dict.fromkeys(
            film_of(body, part, version)
            for part in PARTS
            for version in VERSIONS
            for body in sorted(FILLS)
        )
    )
    experiment = OpenedStudy(study).experiment({})
    with tempfile.TemporaryDirectory() as folder:
        store = replace(film_store(experiment), folder=Path(folder))
        begun_s = cpu_time_s()
        store.build(films[:count], no_progress)
        each_s = (cpu_time_s() - begun_s) / count
        film_file = store.file_of(films[0])
        assert film_file is not None
        sound_check = heard(film_file.path)
    film_count = len(FILLS) * len(PARTS) * len(VERSIONS)
    return [
        Row(
            f"{film_count} films, {len(films)} of them different, from {count} drawn",
            each_s * len(films),
            "CPU s",
            MAX_FILMS_S,
        ),
        Row(
            "sound of a film later than its pictures by",
            abs(sound_check.late_ms),
            "ms",
            1000 / RATE_HZ,
        ),
        Row("sound of a film like its recording", sound_check.alike, "", MIN_ALIKE, at_least=True),
    ]


def main(arguments: list[str]) -> int:
    """Print all of them."""
    parser = argparse.ArgumentParser(prog="benchmarks.gestures", description=__doc__)
    parser.add_argument("--studies", type=int, default=200)
    parser.add_argument("--films", type=int, default=3)
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    rows = [
        *measured(minutes=20.0, seeds=20).rows,
        *film_rows(max(1, options.films)),
        *simulated(options.studies, published.PEOPLE).rows,
    ]
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
