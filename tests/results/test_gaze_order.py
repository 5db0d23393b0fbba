"""The order of looks: fixations and what they are on, moves from one thing to another."""

from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.results.test_time_course import selection
from visavis.analysis.gaze.aoi import LOST
from visavis.analysis.gaze.targets import GazeTargets
from visavis.analysis.plots import new_figure
from visavis.analysis.plots.labels import settle
from visavis.analysis.plots.style import figure_style
from visavis.results.figures.gaze_order_figures import (
    gaze_order_figures,
    stays_of_path,
    write_numbers,
)
from visavis.results.gaze_order import (
    FIXATIONS,
    MOVES,
    PER_TRIAL,
    shown_trials,
    with_fixations,
)
from visavis.study.look_measures import second_view
from visavis.study.look_order import fixation_order
from visavis.study.texts import Texts

HZ, MS = 100, 1_000_000
AHEAD_DEG = 20.0
READABLE_PT, COLUMN_MM, MM_PER_IN = 5.8, 85, 25.4


def gaze(*stays: tuple[int, float, int]) -> tuple[GazeTargets, dict[str, Any]]:
    """Gaze that rests for so many samples so far to the right, on a head (or none, or lost)."""
    right = np.radians(np.repeat([deg for _, deg, _ in stays], [n for n, _, _ in stays]))
    hit = np.repeat([head for _, _, head in stays], [n for n, _, _ in stays]).astype(np.int16)
    n = len(hit)
    direction = np.stack([np.sin(right), np.zeros(n), -np.cos(right)], axis=1)
    angle = np.where(hit[:, None] == np.arange(2), 0.5, 30.0)
    stamps = (np.arange(n) * 1000 // HZ).astype(np.int64) * MS
    wide, limit = np.full((n, 2), 2.0), np.full((n, 2), 90.0)
    targets = GazeTargets(stamps, hit != LOST, direction, angle, wide, limit, hit)
    row = {"active_index": 0, "t_start_ns": 0, "t_end_ns": n * 10 * MS}
    return targets, row


def test_a_fixation_is_on_what_most_of_its_usable_samples_are_on() -> None:
    targets, row = gaze((30, 0.0, 0), (30, AHEAD_DEG, 1), (30, -AHEAD_DEG, -1))
    order = list(fixation_order(targets, row))
    assert ["agent", "others", "elsewhere"] == [one["looks_at"] for one in order]
    assert [0, 1, None] == [one["head_index"] for one in order]
    assert [1, 2, 3] == [one["number"] for one in order]
    assert pytest.approx([0, AHEAD_DEG, -AHEAD_DEG], abs=0.01) == [o["right_deg"] for o in order]
    assert pytest.approx([0, 300, 600], abs=25) == [one["onset_ms"] for one in order]


def test_fixations_are_those_that_the_row_of_the_trial_counts() -> None:
    targets, row = gaze((30, 0.0, 0), (20, AHEAD_DEG, -1), (12, 0.0, LOST), (30, 3.0, 1))
    counted = second_view(targets, row)["ivt_fixation_count"]
    assert counted == len(list(fixation_order(targets, row)))


def fixations(*on: tuple[str, int | None], trial: str = "T01", who: str = "07K") -> pd.DataFrame:
    rows = [
        {
            "participant": who,
            "session": 1,
            "trial_id": trial,
            "attempt": 1,
            "number": k + 1,
            "onset_ms": 300.0 * k,
            "duration_ms": 250.0,
            "looks_at": area,
            "head_index": head,
            "right_deg": 5.0 * k,
            "up_deg": float(k),
        }
        for k, (area, head) in enumerate(on)
    ]
    return pd.DataFrame(rows)


def tables_of(*trials: pd.DataFrame, conditions: str = "A") -> tuple[dict[str, pd.DataFrame], Any]:
    every = pd.concat(trials, ignore_index=True)
    names = every[["participant", "trial_id"]].drop_duplicates().itertuples(index=False)
    chosen = selection(*((w, t, conditions[k % len(conditions)]) for k, (w, t) in enumerate(names)))
    return with_fixations({FIXATIONS: every}, chosen, ["condition"]), chosen


def test_a_move_leads_to_something_else_and_trials_without_it_count() -> None:
    moved = fixations(
        ("agent", 0), ("others", 1), ("others", 2), ("others", 2), ("elsewhere", None)
    )
    still = fixations(("agent", 0), ("agent", 0), trial="T02")
    tables, _ = tables_of(moved, still)
    moves = tables[MOVES].set_index(["moves_from", "moves_to"])[PER_TRIAL]
    assert {
        ("agent", "others"): 0.5,
        ("others", "others"): 0.5,
        ("others", "elsewhere"): 0.5,
    } == moves[moves > 0].to_dict()
    assert {2} == set(tables[MOVES]["trials"])
    assert ("agent", "agent") not in moves.index


def test_no_move_leads_from_one_trial_to_the_next() -> None:
    one, other = fixations(("agent", 0)), fixations(("others", 1), trial="T02")
    tables, _ = tables_of(one, other)
    assert 0 == tables[MOVES][PER_TRIAL].sum()


def test_trials_that_do_not_count_have_no_fixations_in_the_table() -> None:
    every = pd.concat([fixations(("agent", 0)), fixations(("agent", 0), trial="T09")])
    chosen = selection(("07K", "T01", "A"))
    tables = with_fixations({FIXATIONS: every}, chosen, ["condition"])
    assert {"T01"} == set(tables[FIXATIONS]["trial_id"])


def analysis(tables: dict[str, pd.DataFrame], chosen: Any, levels: tuple[str, ...]) -> Any:
    return SimpleNamespace(
        tables=tables, selection=chosen, levels={"condition": levels}, is_simulated=True
    )


def test_the_trial_shown_is_the_one_with_the_median_number_of_fixations() -> None:
    on = [("agent", 0), ("others", 1), ("elsewhere", None), ("others", 1), ("agent", 0)]
    many = [fixations(*on[:n], trial=f"T0{n}") for n in (1, 3, 5)]
    (shown,) = shown_trials(analysis(*tables_of(*many), ("A", "B")))
    assert ("07K", "ses-001", "T03") == (shown.participant, shown.session, shown.trial_id)


def test_figures_are_readable_in_a_column_of_85_mm() -> None:
    on = [("agent", 0), ("others", 1), ("elsewhere", None)]
    trials = [fixations(*on, trial=f"T0{k}") for k in range(1, 5)]
    figures = gaze_order_figures(
        analysis(*tables_of(*trials, conditions="ABCD"), tuple("ABCD")), Texts("none", {})
    )
    assert ["scan_paths", "gaze_moves"] == [figure.name for figure in figures]
    for figure in figures:
        shrunk = COLUMN_MM / MM_PER_IN / figure.figure.get_size_inches()[0]
        texts = [t for axes in figure.figure.axes for t in axes.texts if t.get_text()]
        assert texts
        assert min(t.get_fontsize() for t in texts) * shrunk >= READABLE_PT
        assert figure.data.count("\n") > len(on)


def test_without_fixations_there_is_no_figure() -> None:
    assert [] == gaze_order_figures(
        analysis({}, selection(("07K", "T01", "A")), ("A",)), Texts("none", {})
    )


def test_trials_without_any_fixation_do_not_lower_the_mean() -> None:
    mine = fixations(("agent", 0), ("others", 1))
    trials = selection(("07K", "T01", "A"), ("07K", "T02", "A"), ("S01B", "T01", "A"))
    moves = with_fixations({FIXATIONS: mine}, trials, ["condition"])[MOVES]
    assert {"07K"} == set(moves["participant"])
    assert {1} == set(moves["trials"])
    assert 1.0 == moves[PER_TRIAL].sum()


def test_numbers_that_would_hide_each_other_stand_in_one_place() -> None:
    right_deg, up_deg = np.array([0, 20, 20.5, 40, 0.5, 1, 39]), np.array([0, 0, 0.5, 30, 0, 4, 29])
    numbers = [at.words() for at in stays_of_path(right_deg, up_deg)]
    assert ["1, 5–6", "2–3", "4, 7"] == numbers
    apart = [(at.words(), at.middle) for at in stays_of_path(right_deg[:4], up_deg[:4])]
    assert [("1", (0.0, 0.0)), ("2–3", (20.25, 0.25)), ("4", (40.0, 30.0))] == apart


PANEL = np.array([1.9, 1.7])


@given(
    st.lists(st.tuples(st.floats(-30, 30), st.floats(-20, 20)), min_size=1, max_size=20),
    st.sampled_from([1.0, 0.05]),
)
@settings(max_examples=8, deadline=None)
def test_numbers_of_a_path_lie_over_no_other_and_each_is_there_once(
    points: list[tuple[float, float]], spread: float
) -> None:
    right_deg, up_deg = np.round(np.array(points).T * [[1.0], [spread]], 3)
    with figure_style():
        figure = new_figure(*PANEL)
        axes = figure.subplots()
        axes.plot(right_deg, up_deg)
        axes.margins(0.15)
        axes.set_aspect("equal", adjustable="datalim")
        settle(figure)
        texts = write_numbers(axes, right_deg, up_deg)
        figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in texts]
    assert [] == [1 for one, other in combinations(boxes, 2) if one.overlaps(other)]
    numbers: list[int] = []
    for text in texts:
        for span in text.get_text().replace("\n", " ").split(", "):
            first, _, last = span.partition("–")
            numbers += range(int(first), int(last or first) + 1)
    assert list(range(1, len(points) + 1)) == sorted(numbers)
