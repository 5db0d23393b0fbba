"""Practice until a criterion, trials that come again, early ends, and words between blocks."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from tests.sessions import lab_in
from visavis.analysis.session_check import _practice_findings, check_session
from visavis.analysis.session_verdict import Level
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import DataError, DesignError
from visavis.protocol.plan.session_plan import SessionPlan, Trial
from visavis.protocol.session.trial_runner import Outcome, TrialRunner
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.film_store import film_store
from visavis.running.page.other_hosts.bundle import changes_its_course, steps_of_place
from visavis.running.page.steps import PageStep
from visavis.running.page.trial import FilmFailed
from visavis.running.page.visitor import Visitor
from visavis.running.quick import quick_study
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.running.sessions.session_request import Request, simulated_request
from visavis.study.criterion import Criterion, PracticeState, practice_state

STUDY = """
from visavis import Criterion, Factor, Keys, Race, Study, Text

study = Study("inks", factors=[Factor("task", ["name", "match"]), Factor("ink", ["red", "green"])],
              repetitions=4, blocked_by="task", practice=3, calibrate=False, uses=(),
              practice_until=Criterion("answer_is_right", min_01=1.0, max_rounds=4{otherwise}),
              instructions="read", texts="texts"{on})

@study.trial
def trial(t):
    keys = Keys("r", "g", right=t.ink[0])
    answer = yield t.show(Text("x", colour=t.ink), until=keys, limit_s=1)
    if answer.is_right is None:
        yield t.repeat("too slow", at_most=2)
    yield t.show(Text("right" if answer.is_right else "wrong"), seconds=0.1)
    if not t.is_practice and t.task == "{ends_in}" and answer.is_right:
        yield t.end("enough seen", of="{of}")

@study.answer
def answer(seen, response, rng):
    if rng.random() < 0.3:
        return None
    right = seen.stimuli[0].colour[0]
    return right if rng.random() < 0.7 else "rg".replace(right, "")
"""
HELPED = """
from visavis import Factor, Keys, Study, Text

study = Study("helped", factors=[Factor("ink", ["red", "green"])], on="browser", uses=(),
              calibrate=False)

def again(answer, t):
    if answer.option is None:
        yield STEP

@study.trial
def trial(t):
    yield from again((yield t.show(Text("x"), until=Keys("r", "g"), limit_s=2)), t)
"""
WORDS = """
instruction: Go on.
instructions:
  task: {name: Name the ink., match: Match the ink.}
pause: "Rest before part {part} of {parts}."
"""
ROUNDS = "practice_again"
Perform = Callable[[Request], Path]


def request_of(folder: Path, *, on: str = "lab", seed: int = 1, **words: str) -> Request:
    fillers = {"otherwise": "", "ends_in": "nothing", "of": "session"} | words
    fillers["on"] = ', on="browser"' if on == "browser" else ""
    (folder / "texts").mkdir(parents=True, exist_ok=True)
    (folder / "texts" / "en.yaml").write_text(WORDS, "utf-8")
    text = STUDY
    for name, filler in fillers.items():
        text = text.replace(f"{{{name}}}", filler)
    (folder / "inks.py").write_text(text, "utf-8")
    study = find_study(str(folder / "inks.py"))
    config = lab_in(folder, EXAMPLE if on == "browser" else SCREEN_EXAMPLE)
    return simulated_request(study, study.experiment({}), config, label="S01B", index=0, seed=seed)


def session(folder: Path, **words: Any) -> tuple[Recording, pd.DataFrame]:
    recording = Recording(perform_new(request_of(folder, **words)))
    return recording, recording.trials()


def events(recording: Recording, name: str) -> list[dict[str, Any]]:
    found = recording.events()
    return list(found.loc[found["name"] == name, "payload"])


def rounds_of(rows: pd.DataFrame) -> list[list[bool]]:
    """Return, for every round of practice, which of its finished trials were right."""
    done = rows[rows["is_practice"] & (rows["status"] == "complete")]
    right = (done["answer_is_right"] == True).tolist()  # noqa: E712  # empty is not right
    return [right[i : i + 3] for i in range(0, len(right), 3)]


def assert_practised_to_the_criterion(recording: Recording, rows: pd.DataFrame) -> None:
    rounds = rounds_of(rows)
    assert [False] * (len(rounds) - 1) == [all(right) for right in rounds[:-1]]
    assert all(rounds[-1]) or 4 == len(rounds)
    assert len(rounds) - 1 == len(events(recording, ROUNDS))


@pytest.mark.parametrize("on", ["lab", "browser"])
def test_practice_comes_again_until_the_criterion_or_its_last_round(
    on: str, tmp_path: Path
) -> None:
    counts = set()
    for seed in (1, 2, 3, 4):
        recording, rows = session(tmp_path / str(seed), on=on, seed=seed)
        assert_practised_to_the_criterion(recording, rows)
        counts.add(len(rounds_of(rows)))
        assert "complete" == recording.status
        assert 16 == (~rows["is_practice"] & (rows["status"] == "complete")).sum()
    assert len(counts) > 1, "every person practised equally long; the test would see nothing"


@pytest.mark.parametrize("on", ["lab", "browser"])
def test_a_trial_that_asks_for_it_comes_again_at_the_end_of_its_block(
    on: str, tmp_path: Path
) -> None:
    recording, rows = session(tmp_path, on=on)
    again = rows[rows["status"] == "repeated"]
    assert len(again) > 2
    assert {"too slow"} == set(again["reason"])
    assert again["answer"].isna().all()
    main = rows[~rows["is_practice"]]
    for _, block in main.groupby("block"):
        assert block.drop_duplicates("trial_id")["attempt"].eq(1).all()
        first = block["attempt"].eq(1).tolist()
        assert first == sorted(first, reverse=True)
    # Nobody performs a trial more often than it may come again; the last counts as it is.
    assert main.groupby("trial_id")["status"].apply(lambda s: (s == "repeated").sum()).max() <= 2
    assert (main.groupby("trial_id")["status"].last() == "complete").all()
    assert {"complete"} == {trial.status for trial in check_session(recording).trials}


@pytest.mark.parametrize("on", ["lab", "browser"])
def test_a_session_ends_early_with_its_reason_and_its_other_trials_are_left_out(
    on: str, tmp_path: Path
) -> None:
    recording, rows = session(tmp_path, on=on, ends_in="match")
    main = rows[~rows["is_practice"]]
    (ending,) = events(recording, "ended_early")
    assert ("enough seen", "session") == (ending["reason"], ending["of"])
    left = main[main["status"] == "skipped"]
    assert len(left) > 0
    assert {"enough seen"} == set(left["reason"])
    assert 16 == main["trial_id"].nunique()
    assert "complete" == recording.status
    assert any("ended early" in finding.message for finding in check_session(recording).findings)


def test_a_block_that_ends_early_is_followed_by_the_next(tmp_path: Path) -> None:
    _, rows = session(tmp_path, ends_in="name", of="block")
    main = rows[~rows["is_practice"]]
    status = main.groupby(["task", "status"]).size()
    assert status["name", "skipped"] > 0
    assert 8 == status["match", "complete"]


@pytest.mark.parametrize("on", ["lab", "browser"])
def test_check_says_whether_practice_met_its_criterion_amber_where_it_did_not(
    on: str, tmp_path: Path
) -> None:
    levels = set()
    for seed in (1, 2, 3):
        recording, rows = session(tmp_path / str(seed), on=on, seed=seed)
        rounds, right = len(rounds_of(rows)), sum(rounds_of(rows)[-1])
        findings = [f for f in check_session(recording).findings if "practised" in f.message]
        assert [
            f"practised in {rounds} round{'s' if rounds > 1 else ''}; the study's criterion was "
            f"{'met' if right == 3 else 'not met'}: answer_is_right held in {right} of the last 3 "
            "trials, 100% are asked for"
        ] == [f.message for f in findings]
        assert [Level.GREEN if right == 3 else Level.AMBER] == [f.level for f in findings]
        levels |= {f.level for f in findings}
    assert {Level.GREEN, Level.AMBER} == levels, "choose other seeds"


def test_check_says_that_practice_did_not_suffice_where_nothing_followed_it(
    tmp_path: Path,
) -> None:
    with pytest.raises(_Killed):
        perform_new(killed(request_of(tmp_path), 4))
    (path,) = (tmp_path / "data").rglob("ses-001")
    rows = Recording(path).trials()
    assert rows["is_practice"].all()
    (found,) = (f for f in check_session(Recording(path)).findings if "practised" in f.message)
    assert Level.AMBER == found.level
    assert "the study's criterion was not met: answer_is_right held in " in found.message


def test_practice_is_checked_whatever_a_damaged_manifest_holds(tmp_path: Path) -> None:
    recording, _ = session(tmp_path)
    for content in (None, [], {"design": None}, {"design": []}):
        damaged: Any = replace(recording.manifest, configuration=content)  # type: ignore[arg-type]
        recording.manifest = damaged
        (found,) = _practice_findings([("practice_again", {})], [], recording)
        assert "practised in 2 rounds" in found.message
        assert "was not kept" in found.message


@pytest.mark.parametrize("on", ["lab", "browser"])
def test_a_session_may_end_where_practice_does_not_reach_its_criterion(
    on: str, tmp_path: Path
) -> None:
    ended = []
    for seed in range(1, 7):
        _, rows = session(tmp_path / str(seed), on=on, seed=seed, otherwise=', otherwise="end"')
        is_reached = all(rounds_of(rows)[-1])
        ended.append(not is_reached)
        main = rows[~rows["is_practice"]]
        assert {"complete" if is_reached else "skipped"} == set(main["status"]) - {"repeated"}
    assert {True, False} == set(ended), "choose other seeds"


class _Killed(Exception):
    """The end of a process."""


def killed(request: Request, after: int) -> Request:
    """Return a request that is killed once so many trials were performed."""
    done: list[str] = []

    def on_trial(trial_id: str, *_: object) -> None:
        done.append(trial_id)
        if len(done) == after:
            raise _Killed

    return replace(request, on_trial=on_trial)


COLUMNS = ["trial_id", "attempt", "status", "reason", "answer", "answer_is_right"]


@pytest.mark.parametrize(
    ("on", "after"), [*(("lab", n) for n in (1, 3, 4, 6, 9, 14)), ("browser", 4), ("browser", 14)]
)
def test_a_killed_session_goes_on_in_its_block_and_round(
    on: str, after: int, tmp_path: Path
) -> None:
    words = {"ends_in": "match", "on": on}
    _, whole = session(tmp_path / "whole", **words)
    with pytest.raises((_Killed, DataError)):  # a page's server reports it
        perform_new(killed(request_of(tmp_path / "broken", **words), after))
    (path,) = (tmp_path / "broken" / "data").rglob("ses-001")
    recording = Recording(perform_rest(request_of(tmp_path / "broken", **words), path))
    assert_practised_to_the_criterion(recording, recording.trials())
    expected = whole[COLUMNS].astype(str).values.tolist()
    assert expected == recording.trials()[COLUMNS].astype(str).values.tolist()


def test_instructions_and_breaks_have_words_of_their_own_for_each_block(tmp_path: Path) -> None:
    experiment: Any = request_of(tmp_path).experiment
    plan: SessionPlan = experiment.plan(0, 1)
    said = [block.instruction for block in plan.blocks]
    assert ["Name the ink.", "Match the ink."] == said[1:]
    assert "Rest before part 2 of 2." == experiment.pause_before(plan, plan.blocks[2])
    shown = [
        p["prompt"] for p in events(Recording(perform_new(request_of(tmp_path))), "panel_shown")
    ]
    assert "Rest before part 2 of 2." in shown


def test_a_page_shows_words_of_a_break_and_of_another_round(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    texts: list[str] = []
    reply = Visitor.reply

    def note(visitor: Visitor, step: PageStep) -> dict[str, Any]:
        texts.append(step.content.get("text", ""))
        return reply(visitor, step)

    monkeypatch.setattr(Visitor, "reply", note)
    _, rows = session(tmp_path, on="browser")
    again = [
        f"{sum(right)} of 3 were right. Let us practise once more." for right in rounds_of(rows)
    ]
    shown = [text for text in texts if text]
    rests = [f"Rest before part {part} of 2." for part in (1, 2)]
    expected = ["A few scenes to try come first.", *again[:-1]]
    assert [*expected, rests[0], "Name the ink.", rests[1], "Match the ink."] == shown
    assert again[:-1], "choose another seed"


def test_power_sees_repeated_trials_once_and_no_trial_after_an_end(tmp_path: Path) -> None:
    for on in ("lab", "browser"):
        request = request_of(tmp_path / on, on=on, ends_in="match")
        study: Any = request.study
        rows = quick_study(study, request.experiment, _no_tracker, range(3), seed=1).trials
        assert not rows.duplicated(["participant", "trial_id"]).any()
        assert (rows["task"] == "name").sum() == 24
        assert 0 < (rows["task"] == "match").sum() < 24


def test_a_bundle_of_a_study_that_changes_its_course_is_refused(tmp_path: Path) -> None:
    request = request_of(tmp_path, on="browser")
    with pytest.raises(DesignError, match="repeats trials or practice, or ends early"):
        steps_of_place(request, film_store(request.experiment), 0)  # type: ignore[arg-type]


def test_a_course_is_also_changed_by_a_function_that_the_trial_calls(tmp_path: Path) -> None:
    for step, changes in (('t.repeat("slow")', True), ("t.wait(1)", False)):
        (tmp_path / "helped.py").write_text(HELPED.replace("STEP", step), "utf-8")
        assert changes is changes_its_course(find_study(str(tmp_path / "helped.py")).study)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"answer_is_right"', '"answer_is_rihgt"', "did you mean 'answer_is_right'"),
        ("practice=3, ", "", "practice_until needs practice trials"),
        ("min_01=1.0", "min_01=80", "a share above 0"),
        ("max_rounds=4", "max_rounds=0", "1 or more"),
        ('Criterion("answer_is_right", min_01=1.0, max_rounds=4)', "1", "it takes Criterion"),
    ],
)
def test_a_criterion_that_nobody_can_reach_is_refused(
    old: str, new: str, says: str, tmp_path: Path
) -> None:
    request_of(tmp_path)
    file = tmp_path / "inks.py"
    text = file.read_text("utf-8")
    assert old in text
    file.write_text(text.replace(old, new), "utf-8")
    with pytest.raises(DesignError, match=says):
        find_study(str(file)).experiment({})


def test_the_state_of_practice_follows_from_the_rows() -> None:
    def row(right: Any, is_practice: bool = True) -> dict[str, Any]:
        return {"is_practice": is_practice, "answer_is_right": right}

    criterion = Criterion("answer_is_right", min_01=2 / 3)
    rows = [row(True), row(False), row(None), row(1.0), row(True), row(False), row(True, False)]
    assert PracticeState(1, 3) == practice_state(criterion, rows[:3], 3)
    assert PracticeState(2, 3) == practice_state(criterion, rows, 3)
    assert practice_state(criterion, rows, 3).is_reached(criterion)
    assert not practice_state(criterion, rows[:3], 3).is_reached(criterion)
    assert not practice_state(criterion, [], 3).is_reached(criterion)


def _no_tracker(seed: int, index: int) -> Any:
    class Blind:
        delay_ns = 0

        def measure(self, eyes: Any, **_: Any) -> Any:
            directions = eyes["left_direction_head"] * float("nan")
            return directions, directions[:, 0] == 0

    return Blind()


@pytest.mark.parametrize("on", ["lab", "browser"])
def test_nobody_practises_for_ever_where_trials_are_left_out(
    on: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A page whose sounds cannot be played leaves trials out, an operator skips them."""
    counts = iter(range(100))

    def fail(*_: object) -> Any:
        if next(counts) % 3:
            raise FilmFailed("the browser stopped it")
        yield from ()
        return {"answer_is_right": False}

    def skip(runner: TrialRunner, trial: Trial, _: object) -> Outcome:
        if next(counts) % 3:
            runner.skip(trial, "the operator")
            return Outcome("skipped", "the operator")
        outcome = run(runner, trial, None)
        for row in rows_of(runner):
            row["answer_is_right"] = False
        return outcome

    def rows_of(runner: TrialRunner) -> Any:
        experiment: Any = runner._setup.experiment
        return experiment.settings.rows

    run = TrialRunner.run
    if on == "browser":
        monkeypatch.setattr("visavis.running.page.course.perform_on_page", fail)
    else:
        monkeypatch.setattr(TrialRunner, "run", skip)
    recording, _ = session(tmp_path, on=on, otherwise=', otherwise="end"', seed=5)
    assert 3 == len(events(recording, ROUNDS))
    (ending,) = events(recording, "ended_early")
    assert "after 4 rounds" in ending["reason"]


def test_a_trial_that_comes_again_and_ends_the_session_is_refused_with_the_way_out(
    tmp_path: Path,
) -> None:
    request = request_of(tmp_path)
    text = (tmp_path / "inks.py").read_text("utf-8")
    both = text.replace("at_most=2)", 'at_most=2)\n        yield t.end("too slow")')
    (tmp_path / "inks.py").write_text(both, "utf-8")
    study: Any = find_study(str(tmp_path / "inks.py"))
    experiment = study.experiment({})
    with pytest.raises(DesignError, match=r"trial P\d asks for .* only where t.repeat gave False"):
        perform_new(replace(request, study=study, experiment=experiment))
