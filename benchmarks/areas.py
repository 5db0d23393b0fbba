"""Compare which area of interest holds a point with shapely, and measure what it takes.

    python -m benchmarks.areas [--points 100000] [--seed 1] [--json]

Ten polygons of up to 40 corners with notches, and as many points over each. Limits: the same answer
for every point, distances within 1e-9 of it, and
ten milliseconds for the gaze of a second at 1,000 Hz on ten areas.
"""

import argparse
import sys
from collections.abc import Sequence

import numpy as np
import shapely

from benchmarks.table import Row, show
from visavis.lab.clock import StopWatch
from visavis.stimuli.areas import Area, areas_at

WIDTH, HEIGHT = 1920.0, 1080.0
AREAS = 10
RATE_HZ = 1000


def star(rng: np.random.Generator) -> tuple[tuple[float, float], ...]:
    """Return the corners of a polygon with notches, in order of angle."""
    corners = int(rng.integers(3, 41))
    at, far = np.sort(rng.uniform(0, 2 * np.pi, corners)), rng.uniform(50, 520, corners)
    x, y = WIDTH / 2 + far * np.cos(at), HEIGHT / 2 + far * np.sin(at)
    return tuple(zip(x.tolist(), y.tolist(), strict=True))


def main(argv: Sequence[str]) -> int:
    """Print how many answers differ, and times; return 1 where a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(argv)
    rng = np.random.default_rng(options.seed)
    areas = [Area(f"area_{i}", star(rng)) for i in range(AREAS)]
    count = options.points // AREAS
    differing, largest = 0, 0.0
    for area in areas:
        x, y = rng.uniform(0, WIDTH, count), rng.uniform(0, HEIGHT, count)
        polygon = shapely.Polygon(area.outline)
        inside = area.holds(x, y)
        differing += int((inside != shapely.contains_xy(polygon, x, y)).sum())
        away = area.distances(x[~inside], y[~inside], (1.0, 1.0))
        expected = shapely.distance(polygon, shapely.points(x[~inside], y[~inside]))
        largest = max(largest, float(np.abs(away - expected).max()))
    x, y = rng.uniform(0, WIDTH, RATE_HZ), rng.uniform(0, HEIGHT, RATE_HZ)
    times_ms = []
    for _ in range(20):
        watch = StopWatch()
        areas_at(areas, x, y)
        times_ms.append(1000 * watch.elapsed_s())
    rows = [
        Row("points compared", count * AREAS, "points"),
        Row("points that differ from shapely", differing, "points", 0),
        Row("largest difference of distances", largest, "px", 1e-9),
        Row(f"{RATE_HZ} samples on {AREAS} areas", float(np.median(times_ms)), "ms", 10.0),
    ]
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
