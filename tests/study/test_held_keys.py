"""How long a key was held comes from its release alone; without one it is missing."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.running.page.replies import check_reply
from visavis.running.page.steps import PageError, PageStep, page_question
from visavis.running.scripts import simulate
from visavis.study.held_keys import key_held
from visavis.study.measures import TrialRecord
from visavis.study.responses import Rating

MS = 1_000_000
ANSWERED_NS = 5_000 * MS


def record_of(
    presses: list[tuple[int, int, float]] | None, by: str = "keys", **payload: Any
) -> TrialRecord:
    """A trial answered at 5 s, 700 ms after it was asked, with presses (ms, control, level)."""
    about = {"trial_id": "T01", "question": "side", "asked_ns": ANSWERED_NS - 700 * MS}
    about |= {"answered_ns": ANSWERED_NS, **payload}
    other = {**about, "asked_ns": ANSWERED_NS - 900 * MS, "released_ns": ANSWERED_NS + MS}
    columns = np.array(presses or [], float).reshape(-1, 3)
    arrays = {
        "t_host_ns": (columns[:, 0] * MS).astype(np.int64),
        "control": columns[:, 1].astype(int),
        "value_01": columns[:, 2],
        "recording_part": np.ones(len(columns), int),
    }

    class Recorded:
        path = Path("S01B")
        stream_names = () if presses is None else ("responses",)

        def stream_arrays(self, name: str) -> Any:
            return arrays

        def events_named(self, name: str, part: int) -> pd.DataFrame:
            return pd.DataFrame({"payload": [about, other]})

    recording: Any = Recorded()
    row = {"trial_id": "T01", "recording_part": 1, "side_by": by, "side_ms": 700.0}
    return TrialRecord(row, recording)


def held(*arguments: Any, **payload: Any) -> Any:
    of = key_held("side").of
    assert of is not None
    return of(record_of(*arguments, **payload))


@given(
    held_ms=st.integers(1, 9_000),
    before=st.lists(st.tuples(st.integers(0, 4_900), st.integers(0, 3)), max_size=5),
    beside=st.lists(st.tuples(st.integers(5_001, 20_000), st.integers(1, 3)), max_size=5),
    axis=st.booleans(),
)
def test_a_key_is_held_from_its_press_to_its_own_release(
    held_ms: int, before: list[tuple[int, int]], beside: list[tuple[int, int]], axis: bool
) -> None:
    rows = [(5_000, 0, 0.8 if axis else 1.0), (5_000 + held_ms, 0, 0.0)]
    rows += [(5_000 + held_ms // 2, 0, 0.9)] if axis and held_ms > 1 else []
    rows += [(t, c, level) for t, c in before for level in (1.0, 0.0)]
    rows += [(t, c, level) for t, c in beside for level in (1.0, 0.0)]
    assert held_ms == held(sorted(rows, key=lambda row: row[0]))


@pytest.mark.parametrize(
    ("presses", "by"),
    [
        ([(5_000, 0, 1.0)], "keys"),  # the session ended while it was down
        ([(5_000, 0, 1.0), (6_000, 0, 1.0)], "keys"),  # a box that tells of presses alone
        ([(4_990, 0, 1.0), (4_995, 1, 1.0), (5_100, 0, 0.0)], "keys"),  # two on one frame
        ([], "keys"),
        (None, "keys"),
        ([(5_000, 0, 1.0), (5_100, 0, 0.0)], "ray"),
    ],
)
def test_what_no_device_told_is_missing_and_never_zero(presses: Any, by: str) -> None:
    assert None is held(presses, by)


def test_a_board_answers_at_its_frame_and_its_key_was_pressed_before() -> None:
    assert 120 == held([(4_988, 2, 1.0), (5_108, 2, 0.0)])


def test_a_page_tells_of_its_release_itself() -> None:
    assert 85 == held(None, released_ns=ANSWERED_NS + 85 * MS)


@pytest.mark.parametrize(
    ("is_held", "by", "released_ms", "problem"),
    [
        (True, "keys", 250.0, ""),
        (True, "keys", None, ""),
        (True, "keys", 150.0, "released before it was pressed"),
        (True, "mouse", 250.0, "nobody asked"),
        (False, "keys", 250.0, "nobody asked"),
        (True, "keys", "soon", "not a number"),
    ],
)
def test_release_that_cannot_be_or_that_nobody_asked_for_is_refused(
    is_held: bool, by: str, released_ms: Any, problem: str
) -> None:
    question = page_question(Rating("lively", 1, 3), "?", ["1", "2", "3"])
    step = PageStep("watch", {"films": [], "questions": [question | {"is_held": is_held}]})
    answer = {"option": "2", "at_ms": 200.0, "by": by, "released_ms": released_ms}
    reply = {"shown_ms": 100.0, "answers": {"lively": answer}}
    if not problem:
        check_reply(step, reply)
        return
    with pytest.raises(PageError, match=problem):
        check_reply(step, reply)


STUDY = """
from visavis import Factor, Keys, Rating, Scene, Study, key_held

study = Study(
    "held",
    factors=[Factor("load", ["low", "high"])],
    measures=[key_held("lively")],
    {more}
    calibrate=False,
)


@study.trial
def trial(t):
    {show}
    yield {ask}
    yield t.wait(0.5)
"""


PAGE = {
    "more": 'on="browser", uses=(),',
    "show": "pass",
    "ask": 't.ask(Rating("lively", 1, 5))',
}
MONITOR = {
    "more": "",
    "show": 'yield t.show(Scene("two_people"), seconds=0.1)',
    "ask": 't.key(Keys("lively"))',
}


@pytest.mark.parametrize(
    ("words", "expected_ms"), [(PAGE, (80, 80)), (MONITOR, (100, 100))], ids=["page", "monitor"]
)
def test_a_study_measures_it_on_a_page_and_before_a_monitor(
    words: dict[str, str], expected_ms: tuple[float, float], tmp_path: Path
) -> None:
    file = tmp_path / "held.py"
    file.write_text(STUDY.format(**words), "utf-8")
    out = str(tmp_path / "out")
    data = simulate(str(file), 1, output=out, seed=1, parameters={"repetitions": 1})
    values = data.trials()["lively_held_ms"].dropna()
    assert len(values) > 0
    assert values.between(*expected_ms).all()
