"""The study of adjectives: its raters judge what is measured, its tables find what was planted."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.adjectives.clustering import Impressions, adjusted_rand, rating_cube
from visavis.experiments.adjectives.pairs import FACTORS, PAIRS, PRINTED
from visavis.experiments.adjectives.prediction import left_out_r2
from visavis.experiments.adjectives.raters import (
    LOADINGS,
    drawn_ratings,
    expected_impressions,
    mean_rating,
)
from visavis.experiments.adjectives.study import answer, study
from visavis.experiments.adjectives.walks import (
    BESIDE,
    RATED,
    REFERENCE,
    WALKS,
    figures,
    impressions_seen,
    walk_name,
    walk_of,
)
from visavis.lab.geometry import Vector
from visavis.results.opened_study import OpenedStudy
from visavis.running.quick import quick_study
from visavis.stimuli.motion.synthesis.example_blend import Blend
from visavis.stimuli.motion.synthesis.examples import examples_of_clips
from visavis.stimuli.motion.synthesis.style_weights import fit_weights
from visavis.stimuli.motion.synthesis.walk_styles import walk_set
from visavis.study.live import Live, LiveScene
from visavis.study.responses import Rating
from visavis.study.study_functions import Seen

RATERS = 14


@cache
def means() -> Vector:
    """Return what every pair of every walk is rated on average (pairs, walks)."""
    felt = [impressions_seen(walk_of(walk), walk_of(REFERENCE)) for walk in WALKS]
    return np.array([[mean_rating(pair, one) for one in felt] for pair in PAIRS])


def rated(seed: int) -> Impressions:
    """Return the ratings of a study as its simulated raters give them."""
    rng = np.random.default_rng(seed)
    return Impressions(WALKS, drawn_ratings(means(), RATERS, rng))


def test_every_pair_is_asked_of_every_walk_on_one_list() -> None:
    experiment = OpenedStudy(study).experiment({})
    assert len(experiment.read) == len(WALKS) == 27
    for trial in experiment.read.values():
        ratings = [r for r in trial.responses if isinstance(r, Rating)]
        assert tuple(r.name for r in ratings) == PAIRS
        assert {(r.low, r.high) for r in ratings} == {(-2, 2)}
    assert 41 == len(PAIRS) == len(set(PAIRS))


def test_printed_tables_have_27_and_29_pairs_of_the_41() -> None:
    for motions, sizes in (("A", [3, 10, 8, 6]), ("B", [2, 6, 10, 11])):
        assert [len(PRINTED[motions][factor]) for factor in FACTORS] == sizes
        pairs = [pair for own in PRINTED[motions].values() for pair in own]
        assert len(pairs) == len(set(pairs))
        assert set(pairs) <= set(PAIRS)


def test_orders_of_walks_are_balanced() -> None:
    experiment = OpenedStudy(study).experiment({})
    first = [
        next(
            walk_name(str(t.factors["emotion"]), str(t.factors["speed"]))
            for t in experiment.plan(i, 1).trials
        )
        for i in range(54)
    ]
    assert {first.count(walk) for walk in WALKS} == {2}


def test_planted_clusters_are_found_in_forty_studies() -> None:
    kept, alike = [], []
    for seed in range(40):
        found = rated(seed)
        kept.append(len(found.kept))
        alike.append(adjusted_rand(found.cluster_of, [LOADINGS[p].factor for p in found.kept]))
    assert 25 <= min(kept)
    assert max(kept) <= 31
    assert np.median(alike) >= 0.9


def ratings_of(walk: Blend, seed: int = 4) -> list[int]:
    """Return how one rater describes a walk beside the normal one."""
    names, normal = walk.examples.names, figures().examples.index(REFERENCE)
    live = Live(walk.examples, character=RATED, beside=BESIDE)
    own = dict(zip(names, walk.weights.tolist(), strict=True))
    scene = LiveScene(live, own, beside={names[normal]: 1.0})
    seen = Seen(None, None, 2.0, np.zeros(0), effect=True, leaning=0.3, figures=scene)
    rng = np.random.default_rng(seed)
    return [answer(seen, Rating(pair, -2, 2), rng) for pair in PAIRS]


def test_other_names_of_walks_change_no_rating() -> None:
    walk = walk_of("misery_slow")
    names = tuple(reversed(walk.examples.names))
    renamed = Blend(replace(walk.examples, names=names), walk.weights, in_place=True)
    assert ratings_of(renamed) == ratings_of(walk)


def test_exchanging_two_motions_exchanges_their_ratings() -> None:
    sad, glad = walk_of("misery_slow"), walk_of("excitement_fast")
    walks, order = sad.examples, np.arange(27)
    a, b = walks.index("misery_slow"), walks.index("excitement_fast")
    order[[a, b]] = b, a
    clips = [walks.clip(i) for i in order]
    swapped = examples_of_clips(walks.names, clips, walks.key_s[order], walks.heel_m)
    assert ratings_of(sad) != ratings_of(glad)
    assert ratings_of(Blend(swapped, sad.weights, in_place=True)) == ratings_of(glad)
    assert ratings_of(Blend(swapped, glad.weights, in_place=True)) == ratings_of(sad)


def test_whom_walks_leave_cold_rates_at_random() -> None:
    rng = np.random.default_rng(3)
    cold = Seen(None, None, 1.0, np.zeros(0), effect=False, leaning=0.0)
    given = [answer(cold, Rating("sad_happy", -2, 2), rng) for _ in range(400)]
    assert np.mean(given) == pytest.approx(0.0, abs=0.12)


def test_raters_on_the_page_keep_what_the_source_kept() -> None:
    opened = OpenedStudy(study)
    rows = quick_study(opened, opened.experiment({}), tracker_of, range(6), seed=2).trials
    cube = rating_cube(rows, WALKS)
    assert cube.shape == (6, 41, 27)
    found = Impressions(WALKS, cube)
    assert len(set(found.kept) & {p for own in PRINTED["B"].values() for p in own}) >= 25
    single, alpha = found.reliability("slow_fast")
    assert single > 0.6
    assert alpha > 0.9
    # A rating that is missing leaves its rater out; nothing is filled in.
    rows.loc[rows.index[0], "sad_happy"] = np.nan
    assert rating_cube(rows, WALKS).shape[0] == 5


def test_names_of_raters_and_constant_pairs_change_nothing() -> None:
    found = rated(1)
    turned = Impressions(WALKS, found.ratings[::-1].copy())
    assert turned.cluster_of == found.cluster_of
    assert np.abs(turned.primary - found.primary).max() < 1e-12
    constant = found.ratings.copy()
    constant[:, PAIRS.index("hard_soft")] = 0.0
    assert Impressions(WALKS, constant).cluster_of == found.cluster_of


def test_the_impression_matrix_spans_a_space_that_blends() -> None:
    found = rated(2)
    assert found.primary.min() >= 0.0
    assert found.primary.max() <= 1.0
    fitted = fit_weights(found.primary)
    assert np.abs(fitted.at(found.primary) - np.eye(27)).max() < 1e-9
    assert list(found.matrix().columns[:5]) == ["name", *FACTORS]
    expected = expected_impressions(walk_set("set_b"))
    for k in range(len(FACTORS)):
        assert np.corrcoef(expected[:, k], found.primary[:, k])[0, 1] > 0.9


def test_partitions_are_compared_as_defined() -> None:
    # Hubert & Arabie's index of two partitions, computed by hand.
    assert adjusted_rand("aabbcc", "xxyyzz") == 1.0
    assert adjusted_rand("aaabbb", "xxyyzz") == pytest.approx((2 - 1.2) / (4.5 - 1.2))
    assert adjusted_rand("aabb", "xyxy") < 0


def test_adjectives_are_told_from_features_of_other_walks() -> None:
    rng = np.random.default_rng(1)
    features = rng.standard_normal((27, 51))
    follows = features[:, :3].sum(axis=1) + features[:, 3]
    assert left_out_r2(np.column_stack([features[:, :4]] * 3), follows) > 0.9
    assert left_out_r2(features, rng.standard_normal(27)) < 0.3
