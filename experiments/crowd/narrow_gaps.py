"""Shoulders at gaps that somebody squeezes through, beside the published measure of every gap.

Cells are Delaunay triangles, so the crowd's outline has edges of several metres between people
whom nobody passes between; the published angle counts their crossings like any other.
"""

import pandas as pd

NARROW_COLUMNS = ("shoulders_to_gap_narrow_deg", "crossings_narrow")


def with_narrow_gaps(
    trials: pd.DataFrame, crossings: pd.DataFrame | None, narrow_gap_m: float
) -> pd.DataFrame:
    """Return the trials with two more columns: the mean angle at gaps so wide at most, and how
    many there were. Without any the angle is missing; without cells the count is, too.
    """
    angle, count = NARROW_COLUMNS
    angles: dict[tuple[str, str], float] = {}
    counts: dict[tuple[str, str], int] = {}
    if crossings is not None and len(crossings):
        is_narrow = pd.to_numeric(crossings["centres_apart_m"]) <= narrow_gap_m
        rows = crossings.loc[is_narrow, ["participant", "trial_id"]].astype(str)
        rows["deg"] = pd.to_numeric(crossings["shoulders_to_gap_deg"], errors="coerce")
        for key, walk in rows.groupby(["participant", "trial_id"])["deg"]:
            who = (str(key[0]), str(key[1]))
            angles[who], counts[who] = float(walk.mean()), len(walk)
    keys = [
        (str(p), str(t)) for p, t in zip(trials["participant"], trials["trial_id"], strict=True)
    ]
    found = trials.copy()
    found[angle] = [angles.get(key, float("nan")) for key in keys]
    found[count] = pd.array([counts.get(key, 0) for key in keys], "Int64")
    if "crossings" in found:
        found[count] = found[count].mask(found["crossings"].isna())
    return found
