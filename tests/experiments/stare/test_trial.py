"""One trial, performed with a gaze that is told where to look."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.experiments.stare.performance import FRAME_NS, SAMPLE_NS, Performance, perform
from visavis.experiments.stare.design import StareParameters
from visavis.experiments.stare.study import experiment_of, plan_session
from visavis.experiments.stare.trial import run_trial
from visavis.lab.geometry import angle_deg, unit
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import TrialInterrupted
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.audience import MARK_M, PARTICIPANT_EYE_M, PLACES, SPEAKER_EYE_M

MS = 1_000_000
PARAMS = StareParameters(trial_s=2.0, intertrial_s=0.5, practice_s=1.0)
ACTIVE = PLACES.index("left_middle")
OTHER = PLACES.index("right_close")


def trial_of(condition: str) -> Trial:
    template = plan_session(0, 1).trials[1]
    factors: dict[str, Any] = {"zone": "left", "depth": "middle", "place": "left_middle"}
    return replace(template, factors={"condition": condition, **factors})


def off_target_deg(picture: SceneFrame, agent: int, point_m: np.ndarray) -> float:
    eye_m = picture.scene.agents[agent].eye_centre_m
    return float(angle_deg(picture.gaze_direction[agent], unit(point_m - eye_m)))


def stares(done: Performance, agent: int, after_ms: float) -> bool:
    """Tell whether an agent looks at the participant, or else at the speaker."""
    picture = done.picture_at(int(done.row["t_start_ns"] + after_ms * MS))  # type: ignore[operator]
    at_participant = off_target_deg(picture, agent, PARTICIPANT_EYE_M) < 0.3
    assert at_participant != (off_target_deg(picture, agent, SPEAKER_EYE_M) < 0.3)
    return at_participant


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        ("A", (False, False, False)),
        ("D", (True, True, True)),
        ("AD", (False, True, True)),
        ("DA", (True, False, False)),
    ],
)
def test_active_agent_stares_as_its_condition_says_and_nobody_else_does(
    condition: str, expected: tuple[bool, bool, bool]
) -> None:
    done = perform(
        run_trial(trial_of(condition), PARAMS), lambda t: ACTIVE if t > 500 * MS else None
    )

    assert expected == tuple(stares(done, ACTIVE, ms) for ms in (400, 700, 1900))
    for other in set(range(11)) - {ACTIVE}:
        assert not any(stares(done, other, ms) for ms in (0, 700, 1900))


def test_time_zero_is_the_first_frame_that_shows_the_scene() -> None:
    done = perform(run_trial(trial_of("D"), PARAMS))

    assert done.frames_ns[1] == done.row["t_start_ns"] == done.pictures[0][0]
    assert stares(done, ACTIVE, 0)
    assert ("scene_on", done.frames_ns[1]) == (done.marks[0][1].name, done.marks[0][0])


@pytest.mark.parametrize("condition", ["AD", "DA"])
def test_gaze_changes_with_the_first_sample_on_the_head(condition: str) -> None:
    done = perform(
        run_trial(trial_of(condition), PARAMS), lambda t: ACTIVE if t >= 500 * MS else OTHER
    )
    start_ns = done.row["t_start_ns"]
    look_ns = done.row["look_ns"]

    assert 0 <= look_ns - start_ns - 500 * MS < SAMPLE_NS  # type: ignore[operator]
    assert "look" == done.row["switch_cause"]
    # The frame that brings the sample, then the frame that shows the change.
    assert FRAME_NS <= done.row["switch_ns"] - look_ns <= 2 * FRAME_NS  # type: ignore[operator]
    assert done.row["switch_ns"] in done.frames_ns


@pytest.mark.parametrize("condition", ["AD", "DA"])
def test_gaze_changes_at_half_time_when_the_agent_is_never_looked_at(condition: str) -> None:
    done = perform(run_trial(trial_of(condition), PARAMS), lambda _: OTHER)

    assert "time" == done.row["switch_cause"]
    assert done.row["look_ns"] is None
    assert 1000 <= done.row["switch_ms"] <= 1000 + 2 * FRAME_NS / MS  # type: ignore[operator]


@pytest.mark.parametrize("condition", ["AD", "DA"])
def test_change_is_marked_with_its_cause_and_direction(condition: str) -> None:
    done = perform(run_trial(trial_of(condition), PARAMS), lambda _: ACTIVE)
    ((t_ns, mark),) = [m for m in done.marks if m[1].name == "gaze_change"]

    assert t_ns == done.row["switch_ns"] == mark.payload["t_ns"]
    assert "look" == mark.payload["cause"]
    assert {"AD": "directed", "DA": "averted"}[condition] == mark.payload["to"]
    assert ACTIVE == mark.payload["active_index"]


@pytest.mark.parametrize("condition", ["A", "D"])
def test_nothing_changes_in_static_conditions(condition: str) -> None:
    done = perform(run_trial(trial_of(condition), PARAMS), lambda _: ACTIVE)

    assert (None, None, None) == tuple(
        done.row[name] for name in ("switch_ns", "switch_ms", "switch_cause")
    )
    assert ["scene_on"] == [m.name for _, m in done.marks]


def test_look_before_the_scene_came_on_triggers_nothing() -> None:
    done = perform(run_trial(trial_of("AD"), PARAMS), lambda t: ACTIVE if t < 0 else OTHER)

    assert "time" == done.row["switch_cause"]


def test_lost_gaze_triggers_nothing() -> None:
    done = perform(run_trial(trial_of("AD"), PARAMS), lambda _: -2)

    assert "time" == done.row["switch_cause"]


def test_look_trigger_waits_as_long_as_it_is_told() -> None:
    params = replace(PARAMS, look_trigger_ms=200.0)
    done = perform(run_trial(trial_of("AD"), params), lambda t: ACTIVE if t >= 300 * MS else OTHER)
    waited_ms = (done.row["switch_ns"] - done.row["look_ns"]) / MS  # type: ignore[operator]

    assert 200 + FRAME_NS / MS <= waited_ms <= 200 + 2 * FRAME_NS / MS
    assert "look" == done.row["switch_cause"]


def test_padding_decides_what_counts_as_looked_at() -> None:
    """Gaze half a degree beside the head's rim is a look only with padding."""
    scene_agent = PLACES.index("left_middle")

    def run(pad_deg: float) -> Performance:
        params = replace(PARAMS, pad_deg=pad_deg)
        beside_m = np.array([0.0, np.tan(np.radians(0.5)) * 2.46 + 0.12, 0.0])
        return perform(
            run_trial(trial_of("AD"), params),
            lambda _: scene_agent,
            head_m=lambda _: PARTICIPANT_EYE_M,
            aim_offset_m=beside_m,
        )

    assert "look" == run(1.0).row["switch_cause"]
    assert "time" == run(0.0).row["switch_cause"]


def test_trial_lasts_its_time_and_ends_at_the_first_frame_that_brings_its_last_sample() -> None:
    done = perform(run_trial(trial_of("A"), PARAMS))
    start_ns, end_ns = done.row["t_start_ns"], done.row["t_end_ns"]

    assert 2000 * MS == end_ns - start_ns  # type: ignore[operator]
    assert end_ns <= done.frames_ns[-1] < end_ns + 2 * FRAME_NS  # type: ignore[operator]
    assert done.gaze[-1].t_ns[-1] >= end_ns


@pytest.mark.parametrize(("delay_ms", "extra_frames"), [(20, 3), (500, 5)])
def test_late_samples_are_waited_for_but_not_for_ever(delay_ms: int, extra_frames: int) -> None:
    done = perform(run_trial(trial_of("A"), PARAMS), sample_delay_ns=delay_ms * MS)
    late_ns = done.frames_ns[-1] - done.row["t_end_ns"]  # type: ignore[operator]

    assert (extra_frames - 2) * FRAME_NS < late_ns <= extra_frames * FRAME_NS
    assert 2000 * MS == done.row["t_end_ns"] - done.row["t_start_ns"]  # type: ignore[operator]


def test_row_names_the_active_agent_also_in_the_averted_condition() -> None:
    done = perform(run_trial(trial_of("A"), PARAMS))
    agent = done.pictures[0][1].scene.agents[ACTIVE]

    assert "left_middle" == agent.place
    assert (ACTIVE, agent.agent_id, agent.character) == tuple(
        done.row[name] for name in ("active_index", "active_agent", "active_character")
    )


def test_staring_eyes_follow_the_participants_head() -> None:
    def head_m(t_ns: int) -> np.ndarray:
        return PARTICIPANT_EYE_M + np.array([0.1 if t_ns > 1000 * MS else 0.0, 0.0, 0.0])

    done = perform(run_trial(trial_of("D"), PARAMS), head_m=head_m)
    late = done.picture_at(done.row["t_start_ns"] + 1500 * MS)  # type: ignore[operator]

    assert 0.01 > off_target_deg(late, ACTIVE, head_m(1500 * MS))
    assert 1.0 < off_target_deg(late, ACTIVE, PARTICIPANT_EYE_M)


def test_agents_blink_and_only_changes_are_shown() -> None:
    done = perform(run_trial(trial_of("A"), replace(PARAMS, trial_s=8.0)))
    openness = np.array([p.eye_openness_01 for _, p in done.pictures])

    assert 0.0 == openness.min()
    assert len(done.pictures) < 0.9 * len(done.frames_ns)
    assert len({id(p.scene) for _, p in done.pictures}) == 1


def test_same_trial_seed_performs_the_same_trial() -> None:
    one, two = (perform(run_trial(trial_of("AD"), PARAMS), lambda _: ACTIVE) for _ in range(2))

    assert one.row == two.row
    for (_, a), (_, b) in zip(one.pictures, two.pictures, strict=True):
        np.testing.assert_array_equal(a.eye_openness_01, b.eye_openness_01)
        np.testing.assert_array_equal(a.gaze_direction, b.gaze_direction)


def test_in_practice_nobody_stares_and_nothing_changes() -> None:
    practice = plan_session(0, 1).trials[0]
    done = perform(run_trial(practice, PARAMS), lambda _: PLACES.index("centre_middle"))

    assert not any(stares(done, agent, 900) for agent in range(11))
    assert done.row["switch_cause"] is None
    assert 1000 * MS == done.row["t_end_ns"] - done.row["t_start_ns"]  # type: ignore[operator]


def trained(**performed: Any) -> tuple[Performance, float, str]:
    """Perform a training; return it, how many seconds it lasted and who ended it."""
    training = plan_session(0, 1).trials[0]
    params = replace(PARAMS, practice_limit_s=5.0)
    done = perform(run_trial(training, params), **performed)
    lasted_ns = int(done.row["t_end_ns"]) - int(done.row["t_start_ns"])  # type: ignore[arg-type]
    (end,) = (mark.payload for _, mark in done.marks if mark.name == "training_end")
    assert training.trial_id == end["trial_id"]
    return done, lasted_ns / 1e9, str(end["by"])


def test_training_lasts_until_the_operator_or_the_participant_ends_it() -> None:
    done, lasted_s, by = trained(is_attended=True, space_ns=3_000 * MS)
    assert (pytest.approx(3.0, abs=0.02), "operator") == (lasted_s, by)
    assert 2 == len(done.prompts)
    assert "space" in done.prompts[0]
    assert "" == done.prompts[1]
    _, lasted_s, by = trained(is_attended=True, key_ns=2_000 * MS)
    assert (pytest.approx(2.0, abs=0.02), "participant") == (lasted_s, by)


def test_training_is_not_ended_before_its_shortest_time() -> None:
    _, lasted_s, by = trained(is_attended=True, space_ns=300 * MS, key_ns=500 * MS)
    assert (5.0, "time") == (lasted_s, by)


def test_training_nobody_watches_ends_after_its_shortest_time() -> None:
    done, lasted_s, by = trained()
    assert (1.0, "time") == (lasted_s, by)
    assert 1 == len(done.prompts)


def test_training_with_one_time_for_shortest_and_longest_ends_by_itself() -> None:
    training = plan_session(0, 1).trials[0]
    done = perform(run_trial(training, replace(PARAMS, practice_limit_s=1.0)), is_attended=True)
    assert 1000 * MS == done.row["t_end_ns"] - done.row["t_start_ns"]  # type: ignore[operator]
    assert [] == done.prompts


def test_agents_blink_to_the_end_of_a_long_training() -> None:
    done, _, _ = trained(is_attended=True, space_ns=4_900 * MS)
    since_ns = int(done.row["t_end_ns"]) - 3_000 * MS  # type: ignore[arg-type]
    late = [p.eye_openness_01.min() for t, p in done.pictures if t >= since_ns]
    assert min(late) < 0.5


def test_interruption_ends_the_plan_without_another_frame() -> None:
    plan = run_trial(trial_of("AD"), PARAMS)
    next(plan)

    with pytest.raises(TrialInterrupted, match="pause"):
        plan.throw(TrialInterrupted("pause"))


def test_intertrial_is_dark_with_the_mark_for_its_time() -> None:
    done = perform(experiment_of(PARAMS).intertrial(trial_of("A")))
    ((_, picture),) = done.pictures

    assert 0 == picture.scene.brightness_01
    np.testing.assert_array_equal(MARK_M, picture.scene.mark_m)
    assert 11 == len(picture.scene.agents)
    assert 500 <= done.row["intertrial_ms"] < 500 + FRAME_NS / MS  # type: ignore[operator]
