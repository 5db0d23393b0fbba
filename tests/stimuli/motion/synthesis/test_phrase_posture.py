"""Posture follows the chain of postures and the rules of gestures, at its thresholds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.lab.errors import DataError
from visavis.stimuli.motion.synthesis.phrase_posture import CLASSES, Habits, Phrase

POSTURES = st.tuples(
    st.sampled_from(["LH", "RH", "2H"]),
    st.sampled_from("abc"),
    st.sampled_from(CLASSES["com"]),
    st.sampled_from(CLASSES["yaw"]),
)
SPEECH = st.lists(POSTURES, min_size=12, max_size=60)


def habits(rows: list[tuple[str, str, str, str]], **settings: float) -> Habits:
    """Return the habits of annotated rows."""
    return Habits(tuple(Phrase(*r) for r in rows), **settings)


@given(SPEECH, st.floats(0, 1))
def test_probabilities_sum_to_one_and_pairs_are_products(
    rows: list[tuple[str, str, str, str]], beta: float
) -> None:
    learnt = habits(rows, beta=beta)
    com, yaw = rows[0][2], rows[0][3]
    try:
        joint = learnt.joint(com, yaw, "RH", "a").reshape(3, 3)
    except DataError:
        return
    assert 1.0 == pytest.approx(joint.sum())
    assert np.allclose(learnt.probability("com", com, "RH", "a"), joint.sum(axis=1))


@given(SPEECH)
def test_without_weight_on_rules_the_chain_alone_counts(
    rows: list[tuple[str, str, str, str]],
) -> None:
    learnt = habits(rows, beta=0.0)
    com = rows[0][2]
    assert np.allclose(learnt.chain("com", com), learnt.probability("com", com, "RH", "a"))


def test_rules_hold_from_their_thresholds_on() -> None:
    row = ("RH", "a", "left", "front")
    rows = [row, ("RH", "b", "right", "front")] + [("LH", "c", "centre", "left")] * 2
    kept = habits(rows, min_support=0.5, min_confidence=0.5).rules("com", "RH", "a")
    assert [("H", "left"), ("H", "right")] == [(r.by, r.posture) for r in kept]
    assert [] == habits(rows, min_support=0.51).rules("com", "RH", "a")
    assert [] == habits(rows, min_support=0.5, min_confidence=0.51).rules("com", "RH", "a")


def test_planted_chain_is_recovered_from_much_speech() -> None:
    rng = np.random.default_rng(5)
    chain = np.array([[0.6, 0.3, 0.1], [0.2, 0.5, 0.3], [0.25, 0.25, 0.5]])
    rows, com = [], 1
    for _ in range(6000):
        com = int(rng.choice(3, p=chain[com]))
        rows.append(("RH", "a", CLASSES["com"][com], "front"))
    learnt = habits(rows)
    for k, posture in enumerate(CLASSES["com"]):
        assert chain[k] == pytest.approx(learnt.chain("com", posture), abs=0.04)


def test_postures_that_are_unknown_or_never_left_are_named() -> None:
    row = ("RH", "a", "left", "front")
    with pytest.raises(DataError, match="phrase 2: yaw is 'up'"):
        habits([row, ("RH", "a", "left", "up")])
    with pytest.raises(DataError, match="com right"):
        habits([row, row]).chain("com", "right")
    with pytest.raises(DataError, match="beta"):
        habits([row], beta=1.5)
