"""How simulated people mould a figure to look like another: one search for sliders of any kind.

They see how unlike two figures are, with an error in proportion to it (Weber's law), and try one
slider after the other: a little up or down, on as long as it looks better, back where it looks
worse; where no slider helps they go in smaller steps. Every movement takes time. A slider's name
and what it moulds mean nothing to them. To guess, they search in mind: with greater errors, and for
few thoughts, but before anything moves.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector

FIRST_STEP_01: Final = 0.3
MIN_STEP_01: Final = 0.05
"""Steps of a slider as shares of its range."""
LOOK_S: Final = 1.5
"""To judge a walk: somewhat more than a cycle."""
REACH_S: Final = 0.5
DRAG_S: Final = 0.9
"""To take a slider, and to drag it from one end to the other."""
SEES_01: Final = 0.08
IMAGINES_01: Final = 0.15
"""Standard deviations of the logarithm of what is seen of a difference, and imagined of it."""
THOUGHTS: Final = 30
"""Settings that somebody imagines before a guess."""
KEY_S: Final = 0.18
"""From one press of a key to the next."""
ROUGH_M: Final = 0.004
"""How far `rough` distances may be from exact ones."""


@dataclass(frozen=True, eq=False)
class Task:
    """Sliders from `low` to `high` in steps of `step`, all (d,), now at `at`, and what they do.

    `rough_m` and `exact_m` return the distance from the target at values (d,): the first is quick.
    """

    low: Vector
    high: Vector
    step: Vector
    at: Vector
    rough_m: Callable[[Vector], float]
    exact_m: Callable[[Vector], float]

    def moved(self, values: Vector, i: int, share: float) -> Vector:
        """Return values with slider i moved by a share of its range: a step at least, within its
        ends.
        """
        moved = values.copy()
        steps = max(1, round(abs(share) * (self.high[i] - self.low[i]) / self.step[i]))
        goal = values[i] + np.sign(share) * steps * self.step[i]
        moved[i] = np.clip(np.round(goal, 10), self.low[i], self.high[i])
        return moved


@dataclass(frozen=True)
class Movement:
    """A slider was moved to a value, at seconds from the first sight of the figure."""

    t_s: float
    slider: int
    value: float


@dataclass(frozen=True, eq=False)
class Outcome:
    """Movements in order, the last values, and when the target was reached: None if it was not."""

    moves: tuple[Movement, ...]
    values: Vector
    reached_s: float | None


def match(
    task: Task, within_m: float, limit_s: float, pace: float, rng: np.random.Generator
) -> Outcome:
    """Mould a figure that is seen until it is near its target or the time is over."""
    moves: list[Movement] = []
    spent_s = 0.0

    def try_out(values: Vector, i: int, before: Vector, looks: bool) -> bool:
        """Move a slider; return whether there was time."""
        nonlocal spent_s
        way_01 = abs(values[i] - before[i]) / (task.high[i] - task.low[i])
        spent_s += pace * (REACH_S + DRAG_S * way_01)
        if spent_s > limit_s:
            return False
        moves.append(Movement(spent_s, int(i), float(values[i])))
        spent_s += pace * LOOK_S if looks else 0.0
        return True

    def is_near(values: Vector) -> bool:
        return task.rough_m(values) < within_m + ROUGH_M and task.exact_m(values) < within_m

    if is_near(task.at):
        return Outcome((), task.at, 0.0)
    values, is_reached = _search(
        task, lambda at: _perceived(task.rough_m(at), SEES_01, rng), rng, try_out, is_near
    )
    return Outcome(tuple(moves), values, moves[-1].t_s if is_reached else None)


def guess(task: Task, limit_s: float, pace: float, rng: np.random.Generator) -> Outcome:
    """Set sliders whose figure is not seen to what somebody imagines would be like the target."""
    thoughts = 0

    def think(_values: Vector, _i: int, _before: Vector, looks: bool) -> bool:
        nonlocal thoughts
        thoughts += looks
        return thoughts <= THOUGHTS

    goal, _ = _search(
        task, lambda at: _perceived(task.rough_m(at), IMAGINES_01, rng), rng, think, lambda _: False
    )
    return _set_to(task, goal, pace * LOOK_S, limit_s, pace)


def match_by_any(
    task: Task, within_m: float, limit_s: float, pace: float, rng: np.random.Generator
) -> Outcome:
    """Reach a target as somebody to whom it makes no difference what the sliders are."""
    if task.exact_m(task.at) < within_m:
        return Outcome((), task.at, 0.0)
    begin_s = pace * 60.0 * float(np.exp(0.5 * rng.standard_normal()))
    outcome = _set_to(task, _solution(task), begin_s, limit_s, 0.0)
    is_reached = len(outcome.moves) > 0 and task.exact_m(outcome.values) < within_m
    return Outcome(outcome.moves, outcome.values, outcome.moves[-1].t_s if is_reached else None)


def guess_by_any(
    task: Task, within_m: float, limit_s: float, pace: float, rng: np.random.Generator
) -> Outcome:
    """Guess as near as chance has it, whatever the sliders are."""
    goal_m = within_m * float(rng.uniform(0.8, 1.15))
    solution = _solution(task)
    for share in np.arange(0.0, 1.005, 0.01):
        values = task.at + share * (solution - task.at)
        if task.rough_m(values) <= goal_m:
            break
    places = np.round((values - task.low) / task.step)
    goal = np.round(task.low + task.step * places, 10)
    return _set_to(task, goal, pace * LOOK_S, limit_s, 0.0)


def made_in_turn(moves: Sequence[Movement], takes_s: Callable[[Movement], float]) -> list[Movement]:
    """Return movements as late as each must be that takes so long after the one before."""
    later: list[Movement] = []
    done_s = before_s = 0.0
    for move in moves:
        done_s += max(move.t_s - before_s, takes_s(move))
        before_s = move.t_s
        later.append(replace(move, t_s=done_s))
    return later


def presses(
    moves: Sequence[Movement], start: Vector, step: Vector, pace: float
) -> tuple[list[tuple[float, str]], int]:
    """Return times and controls of presses that make movements on a board, and the last row.

    `step` (d,) is how far a press moves each slider, of which movements are multiples. Who looks
    for long enough before a movement presses meanwhile; where presses take longer, it comes later.
    """
    values, row = start.copy(), 0
    rows_of: list[list[str]] = []
    for move in moves:
        rows = move.slider - row
        steps = round((move.value - values[move.slider]) / step[move.slider])
        controls = ["down" if rows > 0 else "up"] * abs(rows)
        rows_of.append(controls + ["right" if steps > 0 else "left"] * abs(steps))
        values[move.slider], row = move.value, move.slider
    key_s = pace * KEY_S
    of_move = iter(rows_of)
    later = made_in_turn(moves, lambda _: key_s * len(next(of_move)))
    pressed = [
        (move.t_s - key_s * (len(controls) - 1 - k), control)
        for move, controls in zip(later, rows_of, strict=True)
        for k, control in enumerate(controls)
    ]
    return pressed, row


def _perceived(distance_m: float, error_01: float, rng: np.random.Generator) -> float:
    return distance_m * float(np.exp(error_01 * rng.standard_normal()))


def _search(
    task: Task,
    perceived: Callable[[Vector], float],
    rng: np.random.Generator,
    try_out: Callable[[Vector, int, Vector, bool], bool],
    is_near: Callable[[Vector], bool],
) -> tuple[Vector, bool]:
    """Search one slider after the other; return the last values, and whether they are near."""
    values, step_01 = task.at, FIRST_STEP_01
    best = perceived(values)
    while True:
        is_better = False
        for i in rng.permutation(len(values)):
            for sign in rng.permutation([1.0, -1.0]):
                has_helped = False
                while (tried := task.moved(values, i, sign * step_01))[i] != values[i]:
                    if not try_out(tried, i, values, True):
                        return values, False
                    if is_near(tried):
                        return tried, True
                    looks = perceived(tried)
                    if looks >= best:
                        if not try_out(values, i, tried, False):  # back again
                            return tried, False
                        break
                    values, best, has_helped, is_better = tried, looks, True, True
                if has_helped:
                    break
        if not is_better:
            step_01, best = max(step_01 / 2, MIN_STEP_01), perceived(values)


def _set_to(task: Task, goal: Vector, begin_s: float, limit_s: float, pace: float) -> Outcome:
    """Move every slider that is elsewhere to a goal, one after the other."""
    values, t_s, moves = task.at.copy(), begin_s, []
    for i in np.flatnonzero(goal != task.at):
        t_s += pace * (REACH_S + DRAG_S * abs(goal[i] - values[i]) / (task.high[i] - task.low[i]))
        if t_s > limit_s:
            break
        values[i] = goal[i]
        moves.append(Movement(t_s, int(i), float(goal[i])))
    return Outcome(tuple(moves), values, None)


def _solution(task: Task) -> Vector:
    """Return values about as near to the target as sliders lead, found without errors."""
    values, step_01 = task.at, FIRST_STEP_01
    best = task.rough_m(values)
    while step_01 > 0.02:
        is_better = False
        for i in range(len(values)):
            for sign in (1.0, -1.0):
                while (tried := task.moved(values, i, sign * step_01))[i] != values[i]:
                    there = task.rough_m(tried)
                    if there >= best - 1e-5:
                        break
                    values, best, is_better = tried, there, True
        if not is_better:
            step_01 /= 2
    return values
