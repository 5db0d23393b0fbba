"""Studies without effects keep people, conditions and measures, and part them at random."""

import numpy as np
import pandas as pd

from benchmarks.chance_findings import chance_findings, without_effects


def pool() -> pd.DataFrame:
    """Return ten people, two groups of them, in two conditions twice; the measure tells both."""
    who, trial = np.indices((10, 4))
    row = pd.DataFrame({"participant": [f"P{i}" for i in who.ravel()], "trial": trial.ravel()})
    row["cue"] = np.where(trial.ravel() % 2 == 0, "near", "far")
    row["group"] = np.where(who.ravel() < 5, "a", "b")
    row["y"] = 10.0 * who.ravel() + trial.ravel()
    return row


def test_conditions_are_given_out_anew_within_people_and_groups_among_them() -> None:
    rng, gains, same_group = np.random.default_rng(1), [], 0
    for _ in range(60):
        study = without_effects(pool(), ["cue"], 6, rng)
        assert 6 == study["participant"].nunique()
        counts = study.groupby(["participant", "cue"]).size()
        assert [2] == counts.unique().tolist()
        assert (study.groupby("participant")["y"].agg(np.ptp) == 3).all()  # measures stay together
        assert [1] == study.groupby("participant")["group"].nunique().unique().tolist()
        means = study.groupby("cue")["y"].mean()
        gains.append(means["far"] - means["near"])
        same_group += ((study["y"] < 50) == (study["group"] == "a")).mean()
    assert 1 == pool().groupby("cue")["y"].mean().diff().abs().max()
    assert abs(np.mean(gains)) < 3 * np.std(gains) / np.sqrt(60)
    assert 0.35 < same_group / 60 < 0.65


def test_a_study_without_effects_seldom_finds_anything() -> None:
    made = chance_findings("hybrid", studies=20, n=8, pool=12)
    assert (20, 8) == (made.studies, made.n)
    # Of 20 at .05, more than four come by chance in .3 % of runs.
    assert made.counts["anything"] <= 4
    assert 0 == made.counts["primary"]  # equivalence, which is true then, finds nothing
