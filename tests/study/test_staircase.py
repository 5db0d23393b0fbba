"""Staircases: their rule, what they lead to, and their state after a killed session."""

from dataclasses import replace

import numpy as np
import pytest

from tests.sessions import lab_in
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.lab.errors import DesignError, SessionAborted
from visavis.protocol.session.operator import Action, Command, UnattendedOperator
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.new_study import READY
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.running.sessions.session_request import simulated_request
from visavis.study.quest_plus import QuestPlus, QuestPlusTrial
from visavis.study.staircase import Staircase, StaircaseState, StaircaseTrial, after, state_after

UP_DOWN = Staircase("s", start=0.8, step=0.1)
RULE = Staircase("contrast", start=0.3, step=0.4, is_ratio=True, low=0.002)


def levels(staircase, answers):
    """Return the level before each answer and after the last, by letters: r right, w wrong."""
    return [
        round(state_after(staircase, [a == "r" for a in answers[:n]]).level, 9)
        for n in range(len(answers) + 1)
    ]


def test_two_right_in_a_row_go_down_and_one_wrong_goes_up():
    assert levels(UP_DOWN, "rrrwrr") == [0.8, 0.8, 0.7, 0.7, 0.8, 0.8, 0.7]


def test_levels_stay_within_their_bounds():
    assert levels(Staircase("s", 0.9, 0.3), "wwrr") == [0.9, 1.0, 1.0, 1.0, 0.7]


def test_ratios_multiply_and_weights_differ_upwards():
    assert levels(Staircase("s", 0.4, 1.0, down=1, low=0.01, is_ratio=True), "rrw") == [
        0.4,
        0.2,
        0.1,
        0.2,
    ]
    assert levels(Staircase("s", 0.5, 0.1, down=1, step_up=0.3), "rw") == [0.5, 0.4, 0.7]


def test_a_change_of_direction_is_a_reversal():
    states = [state_after(UP_DOWN, [c == "r" for c in "rrwwrr"[:n]]) for n in range(7)]
    assert [s.reversals for s in states] == [0, 0, 0, 1, 1, 1, 2]


@pytest.mark.parametrize(("down", "share"), [(1, 0.5), (2, 0.707), (3, 0.794)])
def test_a_staircase_leads_to_the_share_of_right_answers_that_levitt_gives(down, share):
    """Levels of long runs lie where the planted function has that share."""
    rng, staircase = np.random.default_rng(2), Staircase("s", 0.5, 0.02, down=down)

    def right_at(level):
        return 1 / (1 + np.exp(-(level - 0.5) / 0.08))

    state, seen = StaircaseState(staircase.start), []
    for _ in range(6000):
        seen.append(state.level)
        state = after(staircase, state, bool(rng.random() < right_at(state.level)))
    assert right_at(np.mean(seen[500:])) == pytest.approx(share, abs=0.02)


@pytest.mark.parametrize("threshold", [0.04, 0.16])
def test_a_planted_threshold_is_found_again_within_a_twentieth_in_forty_trials(threshold):
    """The mean of levels at reversals, over people, against the Weibull function's 70.7 %."""
    rng, estimates = np.random.default_rng(1), []
    for _ in range(200):
        state, turned = StaircaseState(RULE.start), []
        for _ in range(40):
            sees = rng.random() < 1 - np.exp(-((state.level / threshold) ** 3))
            coming = after(RULE, state, bool(sees or rng.random() < 0.5))
            if coming.reversals > max(state.reversals, RULE.skip):
                turned.append(state.level)
            state = coming
        estimates.append(np.mean(turned))
    planted = threshold * np.log(0.5 / (1 - 2**-0.5)) ** (1 / 3)
    assert np.mean(estimates) == pytest.approx(planted, rel=0.05)


@pytest.mark.parametrize(
    "wrong", [{"start": 2.0}, {"step": 0.0}, {"is_ratio": True}, {"down": 0}, {"name": "a b"}]
)
def test_a_staircase_that_cannot_work_is_refused(wrong):
    with pytest.raises(DesignError, match="staircase"):
        Staircase(**{"name": "s", "start": 0.5, "step": 0.1, **wrong})


@pytest.mark.parametrize("heard", ["f", "no", 2, [True]])
def test_a_staircase_hears_of_right_and_wrong_and_nothing_else(heard):
    rules = Staircase("s", start=0.5, step=0.1), QuestPlus("s", [1, 2], [1, 2])
    for trial in (StaircaseTrial(rules[0], "", [], {}), QuestPlusTrial(rules[1], "", [], {})):
        with pytest.raises(
            DesignError, match=r"staircase s: take\(.*\); True or False \(answer.is"
        ):
            trial.take(heard)
        trial.take(np.bool_(True))


class _Stops(UnattendedOperator):
    """An operator who ends the session after some frames."""

    def __init__(self, polls):
        super().__init__()
        self._left = polls

    def poll(self):
        """Return the end once it is time."""
        self._left -= 1
        return [Command(Action.ABORT)] if self._left == 0 else []


def request_of(folder, operator=None, text=None):
    source = text or (READY / "contrast.py.txt").read_text("utf-8")
    (folder / "contrast.py").write_text(source, "utf-8")
    study = find_study(str(folder / "contrast.py"))
    config = lab_in(folder, SCREEN_EXAMPLE)
    experiment = study.experiment({"repetitions": 8})
    request = simulated_request(study, experiment, config, label="S01", index=0, seed=1)
    return replace(request, operator=operator or request.operator)


def follows(rows, of):
    """Return the levels of one staircase, and those that follow from its answers in their order."""
    own = rows[rows["contrast_of"] == of]
    answers = own["contrast_is_right"].tolist()
    expected = [state_after(RULE, answers[:n]).level for n in range(len(answers))]
    return own["contrast_level"].tolist(), expected


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    rows = Recording(perform_new(request_of(tmp_path_factory.mktemp("whole")))).trials()
    return rows[rows["status"] == "complete"]


@pytest.mark.parametrize("of", ["2", "8"])
def test_each_staircase_moves_by_its_own_answers(unbroken, of):
    levels, expected = follows(unbroken, of)
    assert levels == expected
    assert unbroken["contrast_threshold"].notna().any()


def test_a_resumed_session_goes_on_at_the_level_that_its_rows_lead_to(tmp_path, unbroken):
    with pytest.raises(SessionAborted):
        perform_new(request_of(tmp_path, _Stops(900)))
    (path,) = (tmp_path / "data").rglob("ses-001")
    before = len(Recording(path).trials())
    assert 4 < before < 28
    rows = Recording(perform_rest(request_of(tmp_path), path)).trials()
    rows = rows[rows["status"] == "complete"]
    assert len(rows) == len(unbroken)
    # The interrupted trial comes last; until then all is as without the interruption.
    first = slice(0, before - 1)
    for column in ("trial_id", "contrast_level", "answer"):
        assert rows[column].tolist()[first] == unbroken[column].tolist()[first]
    for of in ("2", "8"):
        levels, expected = follows(rows, of)
        assert levels == expected
