"""Read the cases of a camera: shots, cuts, the pull of the target, places, what is seen there."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np
import shapely

from tests.reference.interpolation_map import Case, Check, unknown
from tests.stimuli.camera.outlined import outlined_room
from visavis.stimuli.camera.floors import Walkers, walkable_floors
from visavis.stimuli.camera.following import Drive, follow
from visavis.stimuli.camera.obstacles import Obstacles
from visavis.stimuli.camera.shots import (
    LogNormalLengths,
    flow_cosine,
    on_same_side,
    shot_distance_m,
    view_angle_deg,
)
from visavis.stimuli.camera.skeleton import medial_axis
from visavis.stimuli.camera.tracks import RayRules, camera_places, middle_points, tracks_through

COMMON = {"name", "mode", "tol"}
KEEPS_FROM_DEG = 30.0
STEPS_PER_S = 600
WALL_M = 3.0
EYES_M = 1.6
AREA_REL = 1e-6
"""Rooms are drawn in single precision."""
QUANTILE_REL = 1e-7
"""The file's quantiles come from a normal quantile of eight digits, 1.6448536."""
FREE = 1e9
"""A speed that limits nothing."""


def check_camera(where: str, case: Case) -> Iterator[Check]:
    """Compare one case of a known mode."""
    if case["mode"] not in MODES:
        yield Check(f"{where}.mode", f"a mode of {sorted(MODES)}", case["mode"], False)
        return
    entries, check = MODES[case["mode"]]
    yield from unknown(where, case, entries | COMMON)
    yield from check(where, case)


def _close(where: str, expected: float, got: float, tol: float) -> Check:
    return Check(where, expected, got, bool(abs(expected - got) <= tol))


def check_shot_distance(where: str, case: Case) -> Iterator[Check]:
    """Stand as far away as the size of the shot needs."""
    got = shot_distance_m(case["subject_m"], case["fov_v_deg"], case["height_share"])
    yield _close(f"{where}.distance_m", case["distance_m"], got, case["tol"])


def check_cut(where: str, case: Case) -> Iterator[Check]:
    """Judge a cut between two cameras."""
    actor, velocity = np.array(case["actor_m"]), np.array(case["velocity_mps"])
    before, after = np.array(case["pre_m"]), np.array(case["post_m"])
    angle = view_angle_deg(actor, before, after)
    flow = flow_cosine(actor, velocity, before, after)
    same = on_same_side(actor, velocity, before, after)
    yield _close(f"{where}.angle_deg", case["angle_deg"], angle, case["tol"])
    keeps = angle >= KEEPS_FROM_DEG
    yield Check(f"{where}.keeps_30", case["keeps_30"], keeps, case["keeps_30"] == keeps)
    yield _close(f"{where}.flow_cosine", case["flow_cosine"], flow, case["tol"])
    expected = case["same_side_of_line"]
    yield Check(f"{where}.same_side_of_line", expected, same, expected == same)


def check_critical_follow(where: str, case: Case) -> Iterator[Check]:
    """Be drawn to a resting target, in one step and in many."""
    drive = Drive(case["stiffness"], case["mass_kg"], max_speed_mps=FREE)
    start, target = np.array(case["start_m"], float), np.array(case["target_m"], float)
    way, tol = target - start, case["tol"]
    for i, (t_s, expected) in enumerate(case["t_share"]):
        place, _ = follow(start, np.zeros(3), target, t_s, drive)
        got = float((place - start) @ way / (way @ way))
        yield _close(f"{where}.t_share[{i}]", expected, got, tol)
    place, velocity = start, np.zeros(3)
    shares, speeds = [], []
    last_s = max(t_s for t_s, _ in case["t_share"])
    for _ in range(round(last_s * STEPS_PER_S)):
        place, velocity = follow(place, velocity, target, 1 / STEPS_PER_S, drive)
        shares.append(float((place - start) @ way / (way @ way)))
        speeds.append(float(np.linalg.norm(velocity)))
    yield _close(f"{where}.t_share in small steps", case["t_share"][-1][1], shares[-1], tol)
    yield _close(f"{where}.overshoot", case["overshoot"], max(0.0, max(shares) - 1.0), tol)
    # The peak lies between two steps: curvature there bounds what sampling can miss.
    missed = case["peak_speed_mps"] * case["stiffness"] / case["mass_kg"] / STEPS_PER_S**2
    yield _close(f"{where}.peak_speed_mps", case["peak_speed_mps"], max(speeds), tol + missed)


def check_log_normal(where: str, case: Case) -> Iterator[Check]:
    """Draw shot lengths as often as the limit of their distance from the distribution is for."""
    lengths = LogNormalLengths(case["median_s"], case["sigma"])
    yield _close(f"{where}.mean_s", case["mean_s"], lengths.mean_s, 1e-9)
    for share, expected in case["quantiles"].items():
        got = lengths.quantile_s(float(share))
        yield _close(f"{where}.quantiles[{share}]", expected, got, QUANTILE_REL * expected)
    rng = np.random.default_rng(21)
    drawn = np.sort([lengths.draw_s(rng) for _ in range(1000)])
    shares = (np.arange(999) + 1) / 1000
    quantiles = np.array([lengths.quantile_s(s) for s in shares])
    steps = np.searchsorted(drawn, quantiles, side="right") / 1000
    apart = float(np.abs(steps - shares).max()) + 1 / 1000
    limit = case["ks_limit_n1000"]
    yield Check(f"{where}.ks_limit_n1000", f"at most {limit}", apart, apart <= limit)


def check_topology(where: str, case: Case) -> Iterator[Check]:
    """Find the walkable floor of a place with walls and its middle lines."""
    room = outlined_room(where, case["outline_m"], case["holes_m"], WALL_M)
    (floor,) = walkable_floors(room, Walkers(radius_m=0.0))
    lines = medial_axis(floor.area)
    yield _close(f"{where}.area_m2", case["area_m2"], floor.area.area, AREA_REL * case["area_m2"])
    for name, got in (("skeleton_cycles", lines.cycles), ("components", lines.components)):
        yield Check(f"{where}.{name}", case[name], got, case[name] == got)
    inside = bool(shapely.contains_xy(floor.area, *lines.points_m.T).all())
    expected = case["every_skeleton_point_inside"]
    yield Check(f"{where}.every_skeleton_point_inside", expected, inside, expected == inside)


def check_corridor(where: str, case: Case) -> Iterator[Check]:
    """Find the middle line of a corridor, where its rays end, and tracks along it."""
    length, width, tol = case["length_m"], case["width_m"], case["tol"]
    room = outlined_room(
        where, [(0, 0), (length, 0), (length, width), (0, width)], [], case["wall_m"]
    )
    (floor,) = walkable_floors(room)
    walls, lines = Obstacles.of_room(room), medial_axis(floor.area)
    yield _close(f"{where}.axis_length_m", case["axis_length_m"], lines.length_m, tol)
    expected = case["skeleton_cycles"]
    yield Check(f"{where}.skeleton_cycles", expected, lines.cycles, expected == lines.cycles)
    n_middle = len(middle_points(lines, RayRules().every_m)[0])
    for i, ray in enumerate(case["rays"]):
        rules = RayRules(
            from_height_m=case["from_height_m"],
            elevations_deg=(ray["elevation_deg"],),
            straight_up=False,
            back_off_m=case["back_off_m"],
            reach_m=case["d_max_m"],
        )
        found = camera_places(floor, lines, walls, rules)
        at = f"{where}.rays[{i}]"
        yield from unknown(at, ray, {"elevation_deg", "hit", "offset_m", "height_m"})
        yield Check(
            at, f"{2 * n_middle} places", len(found.place_m), len(found.place_m) == 2 * n_middle
        )
        way = found.place_m - found.origin_m
        is_hit = bool(
            (np.linalg.norm(way, axis=1) < case["d_max_m"] - case["back_off_m"] / 2).all()
        )
        yield Check(f"{at}.hit", ray["hit"], is_hit, ray["hit"] == is_hit)
        for name, got in (
            ("offset_m", np.hypot(way[:, 0], way[:, 2])),
            ("height_m", found.place_m[:, 1]),
        ):
            worst = float(got[np.argmax(np.abs(got - ray[name]))])
            yield _close(f"{at}.{name}", ray[name], worst, tol)
    tracks = tracks_through(camera_places(floor, lines, walls), walls, seed=0)
    along = tracks[:, 1] - tracks[:, 0]
    off_deg = np.degrees(np.arctan2(np.hypot(along[:, 1], along[:, 2]), np.abs(along[:, 0])))
    limit = case["tracks_parallel_to_axis_within_deg"]
    is_along = bool(len(tracks) > 0 and off_deg.max() <= limit)
    yield Check(f"{where}.tracks_parallel_to_axis_within_deg", limit, off_deg.max(), is_along)


def check_visibility_2d(where: str, case: Case) -> Iterator[Check]:
    """Look at points from a camera at one height among walls."""
    room = outlined_room(where, case["outline_m"], case["holes_m"], WALL_M)
    walls = Obstacles.of_room(room)
    camera = np.insert(case["camera_m"], 1, EYES_M)
    seen = [walls.sees(camera, np.insert(p, 1, EYES_M)) for p in case["points_m"]]
    for i, (expected, got) in enumerate(zip(case["seen"], seen, strict=True)):
        yield Check(f"{where}.seen[{i}]", expected, got, expected == got)
    yield _close(f"{where}.share", case["share"], float(np.mean(seen)), 1e-12)


MODES: Mapping[str, tuple[set[str], Callable[[str, Case], Iterator[Check]]]] = {
    "shot_distance": (
        {"subject_m", "fov_v_deg", "height_share", "distance_m"}, check_shot_distance,
    ),
    "cut": (
        {
            "actor_m", "velocity_mps", "pre_m", "post_m", "angle_deg", "keeps_30", "flow_cosine",
            "same_side_of_line",
        },
        check_cut,
    ),
    "critical_follow": (
        {"mass_kg", "stiffness", "start_m", "target_m", "t_share", "overshoot", "peak_speed_mps"},
        check_critical_follow,
    ),
    "topology": (
        {
            "outline_m", "holes_m", "area_m2", "skeleton_cycles", "components",
            "every_skeleton_point_inside",
        },
        check_topology,
    ),
    "corridor": (
        {
            "length_m", "width_m", "wall_m", "from_height_m", "back_off_m", "d_max_m",
            "axis_length_m", "skeleton_cycles", "rays", "note",
            "tracks_parallel_to_axis_within_deg",
        },
        check_corridor,
    ),
    "visibility_2d": (
        {"outline_m", "holes_m", "camera_m", "points_m", "seen", "share"}, check_visibility_2d,
    ),
    "log_normal": (
        {"median_s", "sigma", "mean_s", "quantiles", "ks_limit_n1000"}, check_log_normal,
    ),
}  # fmt: skip
"""Of each mode, the entries that are read and what compares them."""
ENTRIES = {"mode"}.union(*(entries for entries, _ in MODES.values()))
"""All entries of any mode."""
