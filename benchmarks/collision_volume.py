"""Measure speed and accuracy of the common volume of two people, beside library methods.

    python -m benchmarks.collision_volume [--pairs N] [--small-pairs N] [--peer-pairs N] [--json]

People are generated in new poses (`tests.analysis.collisions.posed_bodies`), pairs have overlapping
boxes. Truth is the same pair with columns 1.5 mm apart (finer where small), checked against an
exact integration of the first pairs. Few of these pairs graze each other, so others are moved apart
until they do, to judge errors near the threshold of a collision. Times are CPU milliseconds on one
thread, the least of `ROUNDS` per pair. Peers run on the first pairs when they are installed: rays
down 1 cm columns by Open3D with triangles culled to the common box, and manifold3d's boolean
(`pip install visavis[peers]`). Ratio is limit / value: 1 or more is within the limit.

The floor of a pair's time is one pass over the corners and triangles of both bodies and the
crossings of the columns alone, of what is near found before. Error and time are one trade-off: the
floor of the worst error is that of the closest columns whose mean time is within its limit, or of
the widest measured where none is, and its line has the whole curve.
"""

import argparse
import importlib
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.table import Row, show
from tests.analysis.collisions.posed_bodies import posed_pair
from visavis.analysis.collisions import ClosedMesh, Settings, common_volume
from visavis.analysis.collisions.columns import bounds
from visavis.analysis.collisions.pair import in_shadow, longest_side
from visavis.analysis.collisions.spans import CrossingBuffers, Surface, cast
from visavis.analysis.collisions.tiles import (
    Lattice,
    reach,
    spread,
    tiles_across,
    to_lattice,
)
from visavis.lab.clock import cpu_time_s
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

ROUNDS = 5
BODIES = ((0.0212, 15_000, 0.5), (0.0158, 27_000, 1.0))
"""Edge length, nominal triangles, limit in ms."""
TRUTH = Settings(cell_m=0.0015, refine_below_m3=3e-4, fine_columns=30_000)
GRAZING_M3, THRESHOLD_M3, SMALL_M3, ACCURATE_FROM_M3 = 2e-7, 1e-6, 5e-6, 1e-5
CELL_M = 0.01
SPACINGS_M = (0.016, 0.012, 0.010, 0.009, 0.008)
ROOM = 65_536
Pair = tuple[ClosedMesh, ClosedMesh]


def cpu_ms(call: Callable[[], object], rounds: int = ROUNDS) -> float:
    """Return the least CPU milliseconds of some calls."""
    least = float("inf")
    for _ in range(rounds):
        began_s = cpu_time_s()
        call()
        least = min(least, cpu_time_s() - began_s)
    return least * 1e3


def open3d_columns(pair: Pair, open3d: Any) -> float:
    """Return the common volume by rays down 1 cm columns, signed crossings, culled triangles."""
    a, b = pair
    low = np.maximum(a.vertices_m.min(0), b.vertices_m.min(0))
    high = np.minimum(a.vertices_m.max(0), b.vertices_m.max(0))
    n = np.maximum(1, np.ceil((high - low)[[0, 2]] / CELL_M)).astype(int)
    x, z = (low[k] + (np.arange(m) + 0.5) * CELL_M for k, m in zip((0, 2), n, strict=True))
    places = np.stack(np.meshgrid(x + 4e-6, z + 4e-6, indexing="ij"), -1).reshape(-1, 2)
    bottom = min(a.vertices_m[:, 1].min(), b.vertices_m[:, 1].min()) - 0.1
    rays = np.zeros((len(places), 6), np.float32)
    rays[:, 0], rays[:, 1], rays[:, 2], rays[:, 4] = places[:, 0], bottom, places[:, 1], 1
    columns, heights, steps = [], [], []
    for number, mesh in enumerate(pair):
        corners = mesh.vertices_m[mesh.faces]
        least, most = corners.min(1), corners.max(1)
        near = ((most[:, [0, 2]] >= low[[0, 2]]) & (least[:, [0, 2]] <= high[[0, 2]])).all(1)
        faces = mesh.faces[near]
        scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        scene.add_triangles(mesh.vertices_m.astype(np.float32), faces.astype(np.uint32))
        found = scene.list_intersections(rays, nthreads=1)
        p, q, r = np.moveaxis(mesh.vertices_m[faces], 1, 0)
        upward = np.cross(q - p, r - p)[:, 1] > 0
        columns.append(found["ray_ids"].numpy().astype(np.int64))
        heights.append(found["t_hit"].numpy().astype(float))
        step = np.where(upward[found["primitive_ids"].numpy()], -1, 1)
        steps.append(np.stack([step * (number == 0), step * (number == 1)], 1))
    column, height = np.concatenate(columns), np.concatenate(heights)
    order = np.lexsort((height, column))
    column, height = column[order], height[order]
    winding = np.cumsum(np.concatenate(steps)[order], axis=0)
    inside = np.all(winding > 0, axis=1)[:-1] & (column[1:] == column[:-1])
    return float(((height[1:] - height[:-1]) * inside).sum() * CELL_M**2)


def manifold_boolean(pair: Pair, manifold3d: Any) -> float:
    """Return the volume of manifold3d's boolean intersection."""
    bodies = [
        manifold3d.Manifold(
            manifold3d.Mesh64(m.vertices_m.astype(np.float64), m.faces.astype(np.uint64))
        )
        for m in pair
    ]
    return float((bodies[0] ^ bodies[1]).volume())


PEERS: tuple[tuple[str, str, float, Callable[[Pair, Any], float]], ...] = (
    ("open3d", "Open3D ray columns with cull", 10.0, open3d_columns),
    ("manifold3d", "manifold3d boolean", 40.0, manifold_boolean),
)


@compiled
def read_faces(vertices_m: Vector, faces: npt.NDArray[np.int32]) -> tuple[Vector, int, float]:
    """Read every corner and every triangle once; return the box (2, 3), how many triangles there
    are, and the sum of their lowest corners' heights.
    """
    lowest_m = 0.0
    for f in range(faces.shape[0]):
        lowest_m += min(
            vertices_m[faces[f, 0], 1], vertices_m[faces[f, 1], 1], vertices_m[faces[f, 2], 1]
        )
    return bounds(vertices_m), faces.shape[0], lowest_m


@dataclass(frozen=True)
class Columns:
    """Two surfaces on the columns through their common box, ready to be crossed: heights (tiles)
    between which crossings count.
    """

    surfaces: tuple[Surface, Surface]
    lattice: Lattice
    low_w: Vector
    high_w: Vector


def columns_of(pair: Pair, cell_m: float = CELL_M) -> Columns:
    """Return the columns that a pair is first measured by."""
    boxes = [bounds(mesh.vertices_m) for mesh in pair]
    low = np.maximum(boxes[0][0], boxes[1][0])
    high = np.minimum(boxes[0][1], boxes[1][1])
    axis = longest_side(low, high)
    n_u, n_v = (
        max(1, int(np.ceil((high[k % 3] - low[k % 3]) / cell_m))) for k in (axis + 1, axis + 2)
    )
    step = np.ones(3)
    step[(axis + 1) % 3] = (high - low)[(axis + 1) % 3] / n_u
    step[(axis + 2) % 3] = (high - low)[(axis + 2) % 3] / n_v
    lattice = Lattice(axis, low, step, n_u, n_v)
    across = tiles_across(n_u)
    tiles = across * tiles_across(n_v)
    least, most = np.full(tiles, low[axis]), np.full(tiles, high[axis])
    parts = []
    for mesh in pair:
        corners, faces = in_shadow(mesh.vertices_m, mesh.faces, axis, low, high)
        deep, tall = np.full(tiles, np.inf), np.full(tiles, -np.inf)
        place, first = to_lattice(corners, lattice, deep, tall)
        deep, tall = spread(deep, across, -1.0), spread(tall, across, 1.0)
        near = reach(place, first, faces, n_u, n_v, deep, tall)
        least, most = np.maximum(least, deep), np.minimum(most, tall)
        parts.append(Surface(place, first, faces, near))
    most[least >= most] = -np.inf
    return Columns((parts[0], parts[1]), lattice, least, most)


def cross_columns(columns: Columns) -> int:
    """Find where both surfaces cross the columns; return how many crossings that are."""
    lattice = columns.lattice
    cells = lattice.n_u * lattice.n_v
    crossings = CrossingBuffers(
        np.empty(ROOM, np.int32), np.empty(ROOM), np.empty(ROOM, np.int8), np.zeros(cells, np.int32)
    )
    n = 0
    for body, surface in enumerate(columns.surfaces):
        below = np.zeros(cells, np.int32)
        n = cast(
            surface,
            lattice.n_u,
            lattice.n_v,
            columns.low_w,
            columns.high_w,
            below,
            crossings,
            n,
            body,
        )
    return n


def floor_ms(pair: Pair) -> float:
    """Return the CPU milliseconds of reading both meshes once and of the columns' crossings."""
    columns = columns_of(pair)

    def read_and_cross() -> None:
        for mesh in pair:
            read_faces(mesh.vertices_m, mesh.faces)
        cross_columns(columns)

    return cpu_ms(read_and_cross)


def trade_off(pairs: Sequence[Pair], true: Vector) -> list[tuple[float, float, float]]:
    """Return spacings of columns in metres, from wide to close, with mean CPU ms and the worst
    error in percent above `SMALL_M3`.
    """
    above = true > SMALL_M3
    curve = []
    for cell_m in SPACINGS_M:
        fine = round(Settings().fine_columns * (CELL_M / cell_m) ** 2)
        measured = partial(common_volume, settings=Settings(cell_m=cell_m, fine_columns=fine))
        took_ms = float(np.mean([cpu_ms(partial(measured, *pair), 3) for pair in pairs]))
        got = np.array([measured(*pair).volume_m3 for pair in pairs])
        worst = float(np.abs(got[above] / true[above] - 1).max() * 100)
        curve.append((cell_m, took_ms, worst))
    return curve


def grazing_pairs(edge_m: float, n_pairs: int) -> list[Pair]:
    """Draw pairs that have 2e-7 to 5e-6 m3 in common, by a measure finer than the one judged.

    People of new poses are moved apart until what they share falls to a number drawn for them.
    """
    rng = np.random.default_rng(2)
    fine = Settings(fine_columns=TRUTH.fine_columns)
    found: list[Pair] = []
    while len(found) < n_pairs:
        a, b = posed_pair(edge_m, rng)
        bearing = rng.uniform(0, 2 * np.pi)
        away = np.array([np.sin(bearing), 0.0, np.cos(bearing)])
        wanted = np.exp(rng.uniform(np.log(GRAZING_M3), np.log(SMALL_M3)))
        near_m, far_m = 0.0, 1.0
        for _ in range(16):
            apart_m = (near_m + far_m) / 2
            moved = ClosedMesh(b.vertices_m + apart_m * away, b.faces)
            volume = common_volume(a, moved, settings=fine).volume_m3
            near_m, far_m = (apart_m, far_m) if volume > wanted else (near_m, apart_m)
        if GRAZING_M3 < volume <= SMALL_M3:
            found.append((a, moved))
    return found


def small_rows(edge_m: float, size: str, n_pairs: int) -> list[Row]:
    """Return the rows of pairs near the threshold."""
    pairs = grazing_pairs(edge_m, n_pairs)
    got = np.array([common_volume(*p).volume_m3 for p in pairs])
    true = np.array([common_volume(*p, settings=TRUTH).volume_m3 for p in pairs])
    above = true > THRESHOLD_M3
    error = np.abs(got / true - 1)[above] * 100
    wrong = int(((got > THRESHOLD_M3) != above).sum())
    name = f"{size}, 1e-6 to 5e-6 m3"
    return [
        Row(f"{name}: worst error", float(error.max()), f"% ({above.sum()})", 10.0),
        Row(f"{name}: median error", float(np.median(error)), "%", 1.0),
        Row(f"{size}, 2e-7 to 5e-6 m3: on the wrong side", wrong, f"of {n_pairs}", 0.5),
    ]


def measure(
    edge_m: float,
    limit_ms: float,
    n_pairs: int,
    n_small: int,
    n_peers: int,
    *,
    mean_ms: float | None = None,
) -> list[Row]:
    """Return the rows of one body size; the mean is held to `mean_ms` where that is given."""
    most_ms = limit_ms if mean_ms is None else mean_ms
    rng = np.random.default_rng(1)
    pairs = [posed_pair(edge_m, rng) for _ in range(n_pairs)]
    common_volume(*pairs[0])
    size = f"{len(pairs[0][0].faces):,} triangles"
    ms = np.array([cpu_ms(partial(common_volume, *pair)) for pair in pairs])
    got = np.array([common_volume(*p).volume_m3 for p in pairs])
    true = np.array([common_volume(*p, settings=TRUTH).volume_m3 for p in pairs])
    error = np.abs(got / np.where(true > 0, true, np.nan) - 1) * 100
    above = true > SMALL_M3
    wrong = int(((got > THRESHOLD_M3) != (true > THRESHOLD_M3)).sum())
    floors = np.array([floor_ms(pair) for pair in pairs])
    passes = "one pass over both meshes and the columns' crossings alone"
    curve = trade_off(pairs, true)
    within = [worst for _, took_ms, worst in curve if took_ms <= most_ms]
    steps = ", ".join(f"{1e3 * m:.0f} mm {worst:.2g} % {t:.2g} ms" for m, t, worst in curve)
    rows = [
        Row(
            f"{size}: pair, mean",
            float(ms.mean()),
            "CPU ms",
            most_ms,
            floor=float(floors.mean()),
            floor_name=passes,
            floor_is_ours=True,
        ),
        Row(f"{size}: pair, median", float(np.median(ms)), "CPU ms", limit_ms),
        Row(
            f"{size}: pair, slowest",
            float(ms.max()),
            "CPU ms",
            floor=float(floors[ms.argmax()]),
            floor_name=f"of that pair {passes}",
            floor_is_ours=True,
        ),
        Row(f"{size}: median error", float(np.median(error[true > ACCURATE_FROM_M3])), "%", 0.5),
        Row(
            f"{size}: worst error above 5e-6 m3",
            float(error[above].max()),
            "%",
            4.0,
            floor=within[-1] if within else curve[0][2],
            floor_name=f"as close as {most_ms:g} ms a pair allow, else the widest ({steps})",
            floor_is_ours=True,
        ),
        Row(f"{size}: pairs on the wrong side of 1e-6 m3", wrong, f"of {n_pairs}", 0.5),
    ]
    if n_small:
        rows += small_rows(edge_m, size, n_small)
    exact = Settings(always_exact=True)
    deep = [k for k in range(n_pairs) if true[k] > ACCURATE_FROM_M3][:3]
    check = [abs(true[k] / common_volume(*pairs[k], settings=exact).volume_m3 - 1) for k in deep]
    rows.append(Row(f"{size}: truth against exact integration", max(check) * 100, "%", 0.1))
    for module, name, times, call in PEERS if n_peers else ():
        try:
            library = importlib.import_module(module)
        except ImportError as problem:
            print(f"{size}: {name} (visavis[peers]): {problem}", file=sys.stderr)
            continue
        some = pairs[:n_peers]
        call(some[0], library)
        peer_ms = np.array([cpu_ms(partial(call, pair, library), 2) for pair in some])
        ours_ms = np.array([cpu_ms(partial(common_volume, *pair)) for pair in some])
        values = np.array([call(pair, library) for pair in some])
        known = true[: len(some)] > ACCURATE_FROM_M3
        off = np.abs(values[known] / true[: len(some)][known] - 1)
        rows += [
            Row(f"{size}: {name}", float(peer_ms.mean()), "CPU ms"),
            Row(f"{size}: {name}, median error", float(np.median(off)) * 100, "%"),
            Row(
                f"{size}: times faster than it",
                float(peer_ms.sum() / ours_ms.sum()),
                "x",
                times,
                at_least=True,
            ),
        ]
    return rows


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 when a limit is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--pairs", type=int, default=120)
    parser.add_argument("--small-pairs", type=int, default=60)
    parser.add_argument("--peer-pairs", type=int, default=20)
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    rows = [
        row
        for edge, _, limit in BODIES
        for row in measure(edge, limit, options.pairs, options.small_pairs, options.peer_pairs)
    ]
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main())
