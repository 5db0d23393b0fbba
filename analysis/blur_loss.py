"""Tell what measures lose by blurred motion: the same session measured as recorded and as shown."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Vector, quat_conjugate, quat_multiply
from visavis.recording.blurring import kind_of
from visavis.recording.reader import Recording

COLUMNS: Final = ("measure", "n", "before", "after", "mean_change", "missing_after")
KEY: Final = ["trial_id", "attempt"]


def motion_of(recording: Recording) -> dict[str, float]:
    """Return height, speed and turning speed of the head and of the body's hips.

    Medians over samples, and over pairs of samples for speeds, in units as named; streams that were
    not recorded are left out.
    """
    medians: dict[str, float] = {}
    for name in recording.stream_names:
        schema = recording.stream_schema(name)
        kind = None if schema is None else kind_of(schema)
        if kind not in ("head", "body"):
            continue
        columns = recording.stream_arrays(name)
        n = len(columns["t_host_ns"])
        place = columns["position_m"].reshape(n, -1, 3)[:, 0].astype(np.float64)
        turn = columns["orientation_wxyz"].reshape(n, -1, 4)[:, 0].astype(np.float64)
        valid = columns["valid"].reshape(n, -1)[:, 0].astype(bool)
        place, turn = place[valid], turn[valid]
        spent_s = np.diff(columns["t_host_ns"][valid]) / NS_PER_S
        has_time = spent_s > 0
        if not has_time.any():
            continue
        what = "head" if kind == "head" else "hips"
        medians[f"{what}_height_m"] = float(np.median(place[:, 1]))
        moved_m = np.linalg.norm(np.diff(place, axis=0), axis=1)
        medians[f"{what}_speed_m_s"] = float(np.median(moved_m[has_time] / spent_s[has_time]))
        turned_deg = _turns_deg(turn)
        medians[f"{what}_turning_deg_s"] = float(
            np.median(turned_deg[has_time] / spent_s[has_time])
        )
    return medians


def _turns_deg(turn: Vector) -> Vector:
    between = quat_multiply(quat_conjugate(turn[:-1]), turn[1:])
    sine = np.linalg.norm(between[:, 1:], axis=1)
    return np.asarray(np.degrees(2 * np.arctan2(sine, np.abs(between[:, 0]))))


def loss_table(
    before: Sequence[pd.DataFrame],
    after: Sequence[pd.DataFrame],
    online: Sequence[set[str]],
    motion: Sequence[tuple[Mapping[str, float], Mapping[str, float]]],
) -> pd.DataFrame:
    """Return a row per measure: its mean as recorded and as shown, over the same trials.

    `before` and `after` hold trial rows of the same sessions; `online` names the columns that the
    session itself wrote, which are no measures. `n` counts values compared, `missing_after` those
    that are gone, `mean_change` is the mean of the absolute differences.
    """
    pairs: dict[str, list[tuple[float, float]]] = {}
    for raw, blurred, own in zip(before, after, online, strict=True):
        left, right = (rows.set_index(KEY) for rows in (raw, blurred))
        for column in [c for c in left if c not in own and c in right]:
            if not pd.api.types.is_numeric_dtype(left[column]) or left[column].dtype == bool:
                continue
            values = pd.concat([left[column], right[column]], axis=1).astype(float)
            pairs.setdefault(str(column), []).extend(values.itertuples(index=False, name=None))
    for raw_motion, shown_motion in motion:
        for name, value in raw_motion.items():
            pairs.setdefault(name, []).append((value, shown_motion.get(name, float("nan"))))
    rows = [_row(name, np.array(values, float).reshape(-1, 2)) for name, values in pairs.items()]
    return pd.DataFrame([row for row in rows if row], columns=list(COLUMNS))


def _row(name: str, values: Vector) -> dict[str, Any] | None:
    there = np.isfinite(values[:, 0])
    if not there.any():
        return None
    pairs = values[there & np.isfinite(values[:, 1])]
    has_pairs = len(pairs) > 0
    return {
        "measure": name,
        "n": int(there.sum()),
        "before": float(pairs[:, 0].mean()) if has_pairs else float(values[there, 0].mean()),
        "after": float(pairs[:, 1].mean()) if has_pairs else float("nan"),
        "mean_change": float(np.abs(pairs[:, 1] - pairs[:, 0]).mean())
        if has_pairs
        else float("nan"),
        "missing_after": int(there.sum()) - len(pairs),
    }
