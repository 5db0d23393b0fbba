"""People who mould a figure after another: one search, whatever sliders are called or mould."""

from collections.abc import Callable

import numpy as np
import pytest

from visavis.lab.geometry import Vector
from visavis.people.moulder import (
    DRAG_S,
    LOOK_S,
    REACH_S,
    THOUGHTS,
    Outcome,
    Task,
    guess,
    guess_by_any,
    match,
    match_by_any,
)

WITHIN_M = 0.06


def task_of(d: int, distance: Callable[[Vector], float], at: float = 0.5) -> Task:
    """Return a task of d sliders from 0 to 1 whose distances are exact at a glance."""
    full = np.ones(d)
    return Task(0 * full, full, 0.01 * full, at * full, distance, distance)


def far(goal: Vector) -> Callable[[Vector], float]:
    """Return the distance from a goal in sliders, as if it were metres."""
    return lambda values: float(np.linalg.norm(values - goal)) / 5


def matched(d: int, seed: int, limit_s: float = 300.0) -> Outcome:
    rng = np.random.default_rng(seed)
    goal = np.linspace(0.1, 0.9, d)
    return match(task_of(d, far(goal)), WITHIN_M, limit_s, 1.0, rng)


def test_few_sliders_lead_to_the_target() -> None:
    for seed in range(10):
        outcome = matched(4, seed)
        assert outcome.reached_s is not None
        assert outcome.reached_s == outcome.moves[-1].t_s < 300
        assert far(np.linspace(0.1, 0.9, 4))(outcome.values) < WITHIN_M


def test_movements_lead_from_the_first_to_the_last_values_in_steps_of_the_slider() -> None:
    outcome = matched(4, 1)
    values = np.full(4, 0.5)
    for move in outcome.moves:
        values[move.slider] = move.value
        assert move.value * 100 == pytest.approx(round(move.value * 100))
        assert 0 <= move.value <= 1
    assert np.array_equal(values, outcome.values)


def test_every_movement_takes_time_and_none_comes_after_the_limit() -> None:
    outcome = matched(27, 2, limit_s=60.0)
    times = np.array([m.t_s for m in outcome.moves])
    assert (np.diff(times) >= REACH_S).all()
    assert times[-1] <= 60.0
    assert len(times) >= 60.0 / (REACH_S + DRAG_S + LOOK_S)


def test_names_and_order_of_sliders_are_not_known() -> None:
    # What is moulded may be turned round: the same people are as fast, on average.
    goal = np.array([0.1, 0.4, 0.6, 0.9])
    spent = []
    for own in (goal, goal[::-1]):
        outcomes = [
            match(task_of(4, far(own)), WITHIN_M, 300.0, 1.0, np.random.default_rng(s))
            for s in range(200)
        ]
        spent.append(np.mean([o.reached_s for o in outcomes if o.reached_s is not None]))
    assert spent[0] == pytest.approx(spent[1], rel=0.15)


def test_a_figure_that_is_near_already_is_left_alone() -> None:
    outcome = match(task_of(2, lambda _: 0.01), WITHIN_M, 300.0, 1.0, np.random.default_rng(1))
    assert (outcome.moves, outcome.reached_s) == ((), 0.0)


def test_coarse_sliders_end_too() -> None:
    full = np.ones(2)
    coarse = Task(0 * full, full, 0.5 * full, 0.5 * full, lambda _: 1.0, lambda _: 1.0)
    outcome = match(coarse, WITHIN_M, 100.0, 1.0, np.random.default_rng(1))
    assert outcome.reached_s is None
    assert {m.value for m in outcome.moves} <= {0.0, 0.5, 1.0}


def test_a_guess_is_made_before_anything_moves_and_within_few_thoughts() -> None:
    looks = []

    def counted(values: Vector) -> float:
        looks.append(values)
        return far(np.array([0.1, 0.9]))(values)

    outcome = guess(task_of(2, counted), 300.0, 1.0, np.random.default_rng(4))
    assert len(looks) <= 2 * THOUGHTS
    assert len(outcome.moves) <= 2
    assert counted(outcome.values) < counted(np.full(2, 0.5))


def test_to_whom_it_makes_no_difference_comes_as_near_and_as_soon_by_any_sliders() -> None:
    found: dict[int, list[tuple[float, float]]] = {2: [], 20: []}
    for d, own in found.items():
        goal = np.linspace(0.2, 0.8, d)
        scale = far(goal)(np.full(d, 0.5)) / 0.1  # as far at the beginning

        def apart(values: Vector, goal: Vector = goal, scale: float = scale) -> float:
            return far(goal)(values) / scale

        for seed in range(200):
            rng = np.random.default_rng([d, seed])
            guessed = guess_by_any(task_of(d, apart), WITHIN_M, 300.0, 1.0, rng)
            done = match_by_any(task_of(d, apart), WITHIN_M, 300.0, 1.0, rng)
            assert done.reached_s is not None or done.moves == ()
            own.append((apart(guessed.values), done.reached_s or 300.0))
    few, many = (np.array(own) for own in found.values())
    assert few[:, 0].mean() == pytest.approx(many[:, 0].mean(), abs=0.003)
    assert np.median(few[:, 1]) == pytest.approx(np.median(many[:, 1]), rel=0.2)
