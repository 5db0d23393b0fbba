"""A laboratory's own walks: a folder of BVH files, and a table that says which cycle to take.

The table is the folder's one .csv file: `name, file, begin_s, end_s`, one row a walk, from one
moment of a cycle to the same one later. Contacts are found, or given in seconds of the file by
columns `left_down_s, right_up_s, right_down_s, left_up_s`. Every other column is a parameter of
the walks from 0 to 1, such as a rated adjective.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from visavis.lab.geometry import (
    Vector,
    quat_conjugate,
    quat_from_yaw_pitch_deg,
    quat_multiply,
    rotate,
)
from visavis.stimuli.motion.bvh import Bvh, read_bvh
from visavis.stimuli.motion.bvh_clip import clip_of_bvh
from visavis.stimuli.motion.clip import Clip, standing_on_floor
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.retarget import retarget
from visavis.stimuli.motion.rotations import IDENTITY, slerp
from visavis.stimuli.motion.skeleton import Skeleton, forward
from visavis.stimuli.motion.synthesis.examples import (
    MIN_EXAMPLES,
    WALK_KEYS,
    Examples,
    examples_of_clips,
    heel_of,
)
from visavis.stimuli.motion.synthesis.walk_styles import FRAME_S, reduced

COLUMNS: Final = ("name", "file", "begin_s", "end_s")
KEY_COLUMNS: Final = tuple(f"{key}_s" for key in WALK_KEYS)
SLOW_01: Final = 0.35
"""A foot stands while heel or ball moves at less than this share of the walk's speed."""
MIN_STANCE_01, MAX_STANCE_01 = 0.3, 0.9
"""Shares of a cycle that a foot of a walker can stand."""


@dataclass(frozen=True, eq=False)
class ExampleFolder:
    """Examples of a folder, and the parameters of its table: `points` (n, d) for d `parameters`."""

    examples: Examples
    parameters: tuple[str, ...]
    points: Vector


def read_examples(
    folder: Path, skeleton: Skeleton | None = None, *, unit_m: float = 0.01
) -> ExampleFolder:
    """Read a folder of walks, on twenty joints or on all those of a canonical `skeleton`.

    Walks are turned to −z, cut to whole frames at 30 a second and closed to a loop.

    Raises:
        MotionError: table or file is missing or broken, by name and row.
    """
    table, where = _table(folder)
    rows = [{str(c): v for c, v in row.items()} for row in table.to_dict("records")]
    bvhs = [_bvh(folder, row, f"{where}, row {i + 2}") for i, row in enumerate(rows)]
    _check_skeletons(table, bvhs)
    clips, keys = [], []
    for row, bvh in zip(rows, bvhs, strict=True):
        walk = retarget(clip_of_bvh(bvh, unit_m=unit_m), skeleton)
        clip, key_s = _cycle(standing_on_floor(walk), row)
        clips.append(clip if skeleton is not None else reduced(clip))
        keys.append(key_s)
    names = tuple(str(name) for name in table["name"])
    own = [c for c in table.columns if c not in (*COLUMNS, *KEY_COLUMNS)]
    return ExampleFolder(
        examples_of_clips(names, clips, np.array(keys)),
        tuple(own),
        table[own].to_numpy(dtype=np.float64).reshape(len(table), len(own)),
    )


def _table(folder: Path) -> tuple[pd.DataFrame, Path]:
    tables = sorted(folder.glob("*.csv")) if folder.is_dir() else []
    if len(tables) != 1:
        raise MotionError(
            f"{folder} holds {len(tables)} tables (.csv); give a folder of BVH files with one, "
            f"columns {', '.join(COLUMNS)}"
        )
    try:
        table = pd.read_csv(tables[0], skipinitialspace=True)
    except (ValueError, OSError) as problem:
        raise MotionError(f"{tables[0]} cannot be read as a table: {problem}") from problem
    missing = [c for c in COLUMNS if c not in table.columns]
    if missing:
        raise MotionError(f"{tables[0]} lacks the columns {', '.join(missing)}")
    if len(table) < MIN_EXAMPLES:
        raise MotionError(f"{tables[0]} lists {len(table)} walks; give at least {MIN_EXAMPLES}")
    for column in (c for c in table.columns if c not in ("name", "file")):
        values = pd.to_numeric(table[column], errors="coerce")
        row = int(np.argmax(~np.isfinite(values))) if not np.isfinite(values).all() else None
        if row is None and column not in (*COLUMNS, *KEY_COLUMNS):
            outside = ~values.between(0.0, 1.0)
            row = int(np.argmax(outside)) if outside.any() else None
        if row is not None:
            raise MotionError(
                f"{tables[0]}, row {row + 2}: {column} is {str(table[column].iloc[row])!r}; give a "
                "number of seconds, or for a parameter one from 0 to 1"
            )
        table[column] = values
    return table, tables[0]


def _bvh(folder: Path, row: Mapping[str, Any], where: str) -> Bvh:
    path = folder / str(row["file"])
    if not path.is_file():
        raise MotionError(f"{where}: there is no file {path}; correct the column file")
    bvh = read_bvh(path)
    begin_s, end_s = float(row["begin_s"]), float(row["end_s"])
    last_s = (len(bvh.values) - 1) * bvh.frame_time_s
    if not 0.0 <= begin_s < end_s <= last_s + bvh.frame_time_s / 2:
        raise MotionError(
            f"{where}: from {begin_s:g} s to {end_s:g} s, but {path.name} lasts {last_s:.2f} s; "
            "give the begin and end of one cycle in it"
        )
    return bvh


def _check_skeletons(table: pd.DataFrame, bvhs: list[Bvh]) -> None:
    first = [joint.name for joint in bvhs[0].joints]
    for name, bvh in zip(table["name"], bvhs, strict=True):
        if (own := [joint.name for joint in bvh.joints]) != first:
            odd = next(iter({*own} ^ {*first}), "their order")
            raise MotionError(
                f"the skeleton of walk {name!r} is not that of {table['name'].iloc[0]!r} "
                f"({odd}); export all with one"
            )


def _cycle(clip: Clip, row: Mapping[str, Any]) -> tuple[Clip, Vector]:
    """Return the cycle of a row as a loop from the left foot's landing, and its key times."""
    begin_s, end_s = float(row["begin_s"]), float(row["end_s"])
    n = max(2, round((end_s - begin_s) / FRAME_S))
    frames = clip.at(np.linspace(begin_s, end_s, n + 1))
    loop = closed(Clip(clip.skeleton, FRAME_S, frames.root_m, frames.orientation_wxyz))
    if all(column in row for column in KEY_COLUMNS):
        given_shares = [(float(row[c]) - begin_s) / (end_s - begin_s) for c in KEY_COLUMNS]
        shares = np.array(given_shares)
    else:
        shares = contacts_of(loop, str(row["name"]))
    # The cycle begins where the left foot lands: at a frame, so that none is between frames.
    start = round(shares[0] * n) % n
    key_s = np.concatenate([np.sort((shares - shares[0]) % 1.0), [1.0]]) * n * FRAME_S
    if len(shares) != len(WALK_KEYS) or not (np.diff(key_s) > 0).all():
        raise MotionError(
            f"contacts of walk {row['name']!r} come in no order of a walk; give {KEY_COLUMNS[0]} "
            f"to {KEY_COLUMNS[-1]} in its table"
        )
    order = (np.arange(n) + start) % n
    root = loop.root_m[order] + np.where(order < start, 1.0, 0.0)[:, None] * loop.travel_m
    root = root - root[0] * np.array([1.0, 0.0, 1.0])
    return replace(loop, root_m=root, orientation_wxyz=loop.orientation_wxyz[order]), key_s


def closed(clip: Clip) -> Clip:
    """Return a cycle whose last frame is its first again as a loop to −z without a jump.

    What is between both ends is spread over the whole cycle.
    """
    n = len(clip.root_m) - 1
    way = clip.root_m[-1] - clip.root_m[0]
    yaw_deg = float(np.degrees(np.arctan2(-way[0], -way[2])))
    if np.hypot(way[0], way[2]) < 0.05:
        yaw_deg = 0.0  # on the spot, as on a treadmill
    turn = quat_from_yaw_pitch_deg(-yaw_deg)
    root = rotate(np.broadcast_to(turn, (n + 1, 4)), clip.root_m - clip.root_m[0] * [1, 0, 1])
    turns = clip.orientation_wxyz.copy()
    turns[:, 0] = quat_multiply(np.broadcast_to(turn, (n + 1, 4)), turns[:, 0])
    share = np.arange(n) / n - 0.5
    travel = root[-1] * np.array([0.0, 0.0, 1.0])
    root = root[:n] - share[:, None] * (root[-1] - root[0] - travel)
    back = quat_multiply(turns[0], quat_conjugate(turns[-1]))
    part = slerp(np.broadcast_to(IDENTITY, back.shape), back, np.abs(share)[:, None])
    part = np.where(share[:, None, None] < 0, quat_conjugate(part), part)
    x, y, z = travel.tolist()
    return Clip(clip.skeleton, clip.frame_s, root, quat_multiply(part, turns[:n]), True, (x, y, z))


def contacts_of(loop: Clip, name: str) -> Vector:
    """Return shares of the cycle at which left and right foot land and leave (`WALK_KEYS`).

    Raises:
        MotionError: a foot never stands, or never leaves the floor.
    """
    n = len(loop.root_m)
    body = forward(loop.skeleton, loop.root_m, loop.orientation_wxyz)
    speed_mps = np.hypot(loop.travel_m[0], loop.travel_m[2]) / loop.duration_s
    shares = {}
    for side in ("left", "right"):
        foot, toes = (loop.skeleton.index(f"{side}_{part}") for part in ("foot", "toes"))
        ball = body.position_m[:, toes]
        heel = body.position_m[:, foot] + rotate(
            body.orientation_wxyz[:, foot], np.broadcast_to(heel_of(loop.skeleton), ball.shape)
        )
        stands = np.zeros(n, dtype=np.bool_)
        for point in (heel, ball):
            after = np.concatenate([point[1:], point[:1] + loop.travel_m])
            slow = np.linalg.norm(after - point, axis=1) / loop.frame_s < SLOW_01 * speed_mps
            stands |= slow & (point[:, 1] < point[:, 1].min() + 0.05)
        begin, length = _longest_run(stands)
        if not MIN_STANCE_01 * n <= length <= MAX_STANCE_01 * n:
            raise MotionError(
                f"walk {name!r} has no contacts of the {side} foot that can be found; give "
                f"{', '.join(KEY_COLUMNS)} in its table, or cut one whole cycle"
            )
        shares[f"{side}_down"], shares[f"{side}_up"] = begin / n, (begin + length) / n % 1.0
    return np.array([shares[key] for key in WALK_KEYS])


def _longest_run(is_on: npt.NDArray[np.bool_]) -> tuple[int, int]:
    """Return begin and length of the longest run in a round."""
    n, best, run = len(is_on), (0, 0), 0
    for k, on in enumerate(np.concatenate([is_on, is_on])):
        run = run + 1 if on else 0
        if run > best[1] and run <= n:
            best = ((k - run + 1) % n, run)
    return best
