"""Facts about single collisions by block: how many, how large, where on the body."""

from typing import Final

import numpy as np
import pandas as pd

from experiments.crowd.analysis import GroupAnalysis
from experiments.crowd.design import CONDITIONS

ARM_PARTS: Final = ("upper_arm", "lower_arm", "hand")


def collision_facts(group: GroupAnalysis, collisions: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Return named numbers per walk by block, of a group's walks that are analysed."""
    kept = group.kept
    rows = counted_of(group, collisions)
    found = {}
    for condition in CONDITIONS:
        walks = int((kept["condition"] == condition).sum())
        block = rows[rows["condition"] == condition] if len(rows) else rows
        if not walks:
            continue
        part = block["body_part"] if len(block) else pd.Series(dtype=str)
        side = block["side"] if len(block) else pd.Series(dtype=str)
        found[condition] = {
            "counted": len(block) / walks,
            "with an arm or hand": float(part.isin(ARM_PARTS).sum()) / walks,
            "on the left side": float((side == "left").sum()) / walks,
            "on the right side": float((side == "right").sum()) / walks,
            "in the middle": float((side == "middle").sum()) / walks,
            "cut by lost tracking or the walk's end": (
                float(block["cut"].sum()) / walks if len(block) else 0.0
            ),
            "largest common volume, median (dm³)": _median(block, "max_volume_dm3"),
            "duration, median (s)": _median(block, "duration_s"),
            "speed at contact, median (m/s)": _median(block, "speed_m_s"),
        }
    return found


def counted_of(group: GroupAnalysis, collisions: pd.DataFrame) -> pd.DataFrame:
    """Return the counted collisions of a group's walks that are analysed."""
    if collisions.empty:
        return collisions
    mine = [
        (str(person), str(trial)) in group.walks
        for person, trial in zip(collisions["participant"], collisions["trial_id"], strict=True)
    ]
    chosen: pd.DataFrame = collisions[np.array(mine) & collisions["counted"].to_numpy(bool)]
    return chosen


def _median(block: pd.DataFrame, column: str) -> float:
    if not len(block):
        return float("nan")
    values = block[column].to_numpy(float)
    values = values[np.isfinite(values)]
    return float(np.median(values)) if values.size else float("nan")
