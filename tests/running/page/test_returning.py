"""A study says how old a begun visit may be and where it goes on; nothing recorded is lost."""

from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from tests.running.page.pages import Page, begin_session, go_on_with, study
from tests.running.page.served_places import Place, serve
from visavis.analysis.session_check import check_session
from visavis.lab.errors import DesignError
from visavis.recording.reader import Recording
from visavis.running.page.client import arrive, visit
from visavis.running.page.earlier_parts import REWOUND_FLAG
from visavis.running.page.other_hosts.bundle import write_bundle
from visavis.running.page.reception import Reception, Rules
from visavis.study.returning import Resumes, Returning


def step_of(page: Page) -> dict[str, Any]:
    step: dict[str, Any] = page.desk.state()["step"]
    return step


def whole(root: Path) -> list[dict[str, Any]]:
    """Return every step of a visit from its beginning to its end."""
    steps = []
    with begin_session(root, "S99") as (page, _):
        while not page.desk.is_over:
            steps.append(step_of(page))
            page.answer()
        page.desk.recorder.close("complete")
    return steps


def first_of(steps: list[dict[str, Any]], cut: int, checkpoint: Resumes) -> int:
    """Return where a visit that was left at a step goes on."""
    n_before = {"step": cut, "start": 1}  # the consent stays given
    if checkpoint in n_before:
        return n_before[checkpoint]

    def unit(step: dict[str, Any]) -> Any:
        if step.get("trial") is None:  # not within a block
            return step["kind"], step.get("title")
        return "block" if checkpoint == "block" else (step["is_practice"], step["trial"])

    first = cut
    while first and unit(steps[first - 1]) == unit(steps[cut]) != ("text", None):
        first -= 1
    return first


@pytest.mark.parametrize("checkpoint", ["step", "trial", "block", "start"])
def test_visit_goes_on_at_its_checkpoint_and_what_was_done_before_stays(
    checkpoint: Resumes, tmp_path: Path
) -> None:
    steps = whole(tmp_path)
    for cut in range(1, len(steps)):
        with begin_session(tmp_path, f"S{cut:02d}") as (page, path):
            for _ in range(cut):
                page.answer()
        before = Recording(path)
        with go_on_with(path, checkpoint) as page:
            first = first_of(steps, cut, checkpoint)
            assert steps[first] == step_of(page), cut
            page.answer()
        # Cut once more, and gone on where it is: what was gone back behind is gone back behind.
        with go_on_with(path) as page:
            if first + 1 < len(steps):
                assert steps[first + 1] == step_of(page), cut
            page.answer_all()
            page.desk.recorder.close("complete")
        after = Recording(path)
        n_events, n_rows = len(before.events()), len(before.trials())
        assert before.events()["payload"].tolist() == after.events()["payload"].tolist()[:n_events]
        rows = after.trials()
        earlier = before.trials()
        assert earlier.to_dict("records") == rows[:n_rows][list(earlier)].to_dict("records")
        assert not rows.duplicated(["trial_id", "attempt"]).any()
        done_again = rows[rows["attempt"] > 1]
        assert set(done_again["trial_id"]) <= set(rows["trial_id"][:n_rows])
        last = rows.sort_values("attempt").drop_duplicates("trial_id", keep="last")
        assert {"complete"} == set(last["status"])
        assert len(last) == len({(s["is_practice"], s["trial"]) for s in steps if s.get("trial")})
        went_back = first < cut
        assert went_back == rows["flags"].str.contains(REWOUND_FLAG).any() or checkpoint == "start"
        questions = after.events()
        n_complete = (questions["name"] == "questionnaire_complete").sum()
        assert 1 <= n_complete <= 2


def come_again(tmp_path: Path, policy: Returning, age_h: float) -> tuple[str, Place]:
    """Leave a visit in its second trial, come back after some hours; return how that ended."""
    place = Place(tmp_path, Rules())
    panel = {"PROLIFIC_PID": "5f3a9c8d2b1e4a7f6c0d9e8b"}

    async def leave(base: str, reception: Reception) -> None:
        reception._returning = policy
        at = await arrive(base, panel)
        await visit(at, place.visitor(), place.clock, ends=lambda s: s.content.get("trial") == 2)

    async def come_back(base: str, reception: Reception) -> str:
        reception._returning = policy
        at = await arrive(base, panel)
        return await visit(at, place.visitor(), place.clock)

    serve(place, leave)
    begun_iso = Recording(place.sessions()[0]).manifest.created_wall_iso
    later = (datetime.fromisoformat(begun_iso) + timedelta(hours=age_h)).isoformat()
    place.clock.wall_iso = lambda: later  # type: ignore[method-assign]  # a later day
    return serve(place, come_back), place


@pytest.mark.parametrize(
    ("policy", "age_h", "outcome", "n_again"),
    [
        (Returning(), 10_000, "done", 0),
        (Returning(within_h=24), 23, "done", 0),
        (Returning(within_h=24), 25, "expired", 0),
        (Returning(within_h=24, later="restart"), 23, "done", 0),
        (Returning(within_h=24, later="restart"), 25, "done", 2),
        (Returning(resumes="start"), 1, "done", 2),
    ],
)
def test_begun_visit_is_refused_started_anew_or_continued_by_its_age(
    policy: Returning, age_h: float, outcome: str, n_again: int, tmp_path: Path
) -> None:
    ending, place = come_again(tmp_path, policy, age_h)
    recording = Recording(place.sessions()[0])
    assert (outcome, 1) == (ending, len(place.sessions()))
    rows = recording.trials()
    assert n_again == (rows["attempt"] > 1).sum()
    if outcome == "expired":
        assert ("aborted", 2) == (recording.status, len(rows))  # what is finished is kept
        assert 1 == len(recording.manifest.parts)
    else:
        assert "complete" == recording.status
        verdict = check_session(recording)
        assert {"complete"} == {trial.status for trial in verdict.trials}


def test_bundle_goes_on_at_its_step_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    declared = study().study
    place = Place(tmp_path, Rules())
    reception = place.reception()
    for policy in (Returning(resumes="trial"), Returning(later="restart")):
        monkeypatch.setattr(declared, "procedure", replace(declared.procedure, returning=policy))
        with pytest.raises(DesignError, match="serve the study"):
            write_bundle(reception._base, reception._store, tmp_path / "web", places=2)


@pytest.mark.parametrize(
    "keywords", [{"within_h": 0}, {"within_h": float("nan")}, {"resumes": "page"}, {"later": "ask"}]
)
def test_policy_that_says_nothing_possible_is_refused(keywords: dict[str, Any]) -> None:
    with pytest.raises(DesignError, match=r"[Rr]eturning: "):
        Returning(**keywords)
