"""The distance of somebody who is shown stands in the row of the answer."""

from dataclasses import replace

import numpy as np
import pytest

from tests.sessions import lab_in, request_in
from visavis.lab.clock import NS_PER_S
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import DesignError
from visavis.protocol.plan.session_plan import Trial
from visavis.recording.reader import Recording
from visavis.results.opened_study import HEADS_AT_ONSET, find_study
from visavis.results.reevaluation import targets_again
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.running.sessions.verification import verify
from visavis.stimuli.dressing.office import look_of
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.study.asking import Answer
from visavis.study.distances import WhenNear, floor_distances_m
from visavis.study.dry_run import still_view
from visavis.study.scenes import Scene, Staging, stage
from visavis.study.trial import TrialScript
from visavis.study.trial_settings import Settings

STUDY = """
from visavis import Factor, Keys, Scene, Study, Text, WhenNear

study = Study("stops", "S", factors=[Factor("a", ["x", "y"])], calibrate=False)
WALK = {"motion": "walk", "distance_m": 3, "speed_mps": 1.0}
STOP = Keys("stop", ["trigger"], distance_to="person")

@study.trial
def trial(t):
    LINES

@study.answer
def answer(seen, response, rng):
    return ANSWER
"""
WALKER = 'yield t.show(Scene("person", **WALK), until=STOP, limit_s=6)'
NEAR = 'WhenNear("trigger", 1.5)'


def opened(folder, lines, answer="'trigger'"):
    text = STUDY.replace("LINES", "\n    ".join(lines)).replace("ANSWER", answer)
    (folder / "stops.py").write_text(text)
    return find_study(str(folder / "stops.py"))


def recording_of(folder, *lines, answer="'trigger'"):
    study = opened(folder, lines, answer)
    about = request_in(folder, study, EXAMPLE)
    return Recording(perform_new(about))


def staged_scene_of(start_ns=0, **options):
    """Return a scene of one person."""
    return stage(Scene("person", **options), Staging(np.random.default_rng(1), 8.0, start_ns), {})


def staged(start_ns=0, **options):
    """Return the first frame of a scene of one person."""
    return staged_scene_of(start_ns, **options).frame(still_view(start_ns), 0)


def test_the_distance_at_a_press_is_the_one_that_the_recording_holds(tmp_path):
    recording = recording_of(tmp_path, WALKER, answer=NEAR)
    rows = recording.trials()
    events = recording.events()
    onsets = [p["start_ns"] for p in events.loc[events["name"] == "shown", "payload"]]
    head = recording.stream_arrays("head")
    assert 2 == len(rows) == len(onsets)
    for start_ns, (_, row) in zip(onsets, rows.iterrows(), strict=True):
        press_ns = round(row["scene_on_ns"] + 1e6 * row["stop_ms"])
        walker = staged(start_ns, motion="walk", distance_m=3, speed_mps=1.0)
        picture = picture_of(replace(walker, t_ns=press_ns))
        people = picture.people
        theirs_m = look_of(picture.cast[0], people.root_m[0], people.orientation_wxyz[0])[1]
        mine_m = head["position_m"][np.searchsorted(head["t_host_ns"], press_ns)]
        expected = np.hypot(theirs_m[0] - mine_m[0], theirs_m[2] - mine_m[2])
        assert expected == pytest.approx(row["stop_distance_m"], abs=0.005)
        # near enough, and on for the quarter of a second that seeing and pressing take
        assert row["stop_distance_m"] == pytest.approx(1.5 - 0.25 * 1.0, abs=0.1)


@pytest.mark.parametrize(
    ("lines", "answer", "is_there"),
    [
        (['yield t.show(Scene("person"), 0.1)', "yield t.key(STOP)"], "'trigger'", True),
        (['yield t.show(Scene("person"), 0.1, until=STOP, limit_s=2)'], "'trigger'", False),
        ([WALKER], 'WhenNear("trigger", 0.1)', False),
    ],
    ids=["while they stay", "after they went", "never"],
)
def test_a_distance_is_there_as_long_as_the_person_is(tmp_path, lines, answer, is_there):
    rows = recording_of(tmp_path, *lines, answer=answer).trials()
    assert [is_there] * 2 == rows["stop_distance_m"].notna().tolist()
    if is_there:
        assert rows["stop_distance_m"].to_numpy() == pytest.approx(2.5, abs=0.2)


def test_heights_make_no_distance():
    frame = staged(distance_m=2.0)
    low, high = (floor_distances_m(frame, 0, np.array([0.0, y, 0.0])) for y in (0.4, 1.9))
    assert low.tolist() == high.tolist()
    nearer = floor_distances_m(frame, 0, np.array([0.0, 1.2, -0.5]))
    assert low[0] - 0.5 == pytest.approx(nearer[0], abs=0.01)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (
            'yield t.show(Scene("person"), until=Keys("stop", ["trigger"], distance_to="persn"))',
            "no role or place 'persn'; did you mean 'person'",
        ),
        ('yield t.show(Text("+"), until=STOP)', "no role or place 'person'; nobody is shown"),
        ("yield t.key(STOP)", "nobody is shown"),
    ],
)
def test_who_is_not_shown_is_told_before_anybody_comes(tmp_path, line, says):
    with pytest.raises(DesignError, match=says):
        opened(tmp_path, [line]).experiment({})


def test_simulated_people_press_when_somebody_has_come_near_enough():
    frame, eyes_m = staged(motion="walk", distance_m=3.0, speed_mps=1.0), np.array([0, 1.2, 0])
    rule = WhenNear("trigger", 1.5, other_s=0.0)
    seconds = rule.seconds(frame, 0, eyes_m, 6.0)
    at_m = floor_distances_m(frame, round(seconds * NS_PER_S), eyes_m)[0]
    assert 1.5 == pytest.approx(at_m, abs=0.02)
    assert seconds + 0.4 == WhenNear("trigger", 1.5, other_s=0.4).seconds(frame, 0, eyes_m, 6.0)
    assert 0.0 == WhenNear("trigger", 3.5, other_s=0.0).seconds(frame, 0, eyes_m, 6.0)
    assert None is WhenNear("trigger", 0.1).seconds(frame, 0, eyes_m, 6.0)
    with pytest.raises(DesignError, match="other_s -1"):
        WhenNear("trigger", 1.0, other_s=-1)


def press(at_ns):
    """Return an answer given at a session time, before a head at rest."""
    return Answer("trigger", "keys", 0, at_ns, still_view(at_ns))


def test_a_press_in_the_last_lit_frame_has_a_distance_and_one_in_the_dark_has_none():
    """Which frame hears of a press says nothing of what was lit when it came."""
    walker = staged_scene_of(motion="walk", distance_m=3, speed_mps=1.0)
    script = TrialScript(Trial("T1", 1, 0, False, {}, 1), Settings({}, *[None] * 6))
    script.showing(walker, 0)
    frame = script._lit_frame = walker.frame(still_view(), 0)
    lit_m = script._distance_m("person", press(NS_PER_S))
    eyes_m = still_view().head.position_m
    assert floor_distances_m(frame, NS_PER_S, eyes_m)[0] == lit_m
    script.put_out()
    script.end_light(2 * NS_PER_S)  # the first dark frame
    assert lit_m == script._distance_m("person", press(NS_PER_S))
    assert script._distance_m("person", press(2 * NS_PER_S)) is None
    assert script._distance_m("person", press(3 * NS_PER_S)) is None


def test_a_session_keeps_the_distance_of_a_press_that_the_first_dark_frame_heard(tmp_path):
    line = 'yield t.show(Scene("person"), SECONDS, until=STOP, limit_s=2)'
    times_ms = recording_of(tmp_path, line.replace("SECONDS", "1.9")).trials()["stop_ms"]
    deeper = tmp_path / "deeper"
    deeper.mkdir()
    # The scene goes at the press itself, to within a frame.
    seconds = f"{times_ms.max() / 1000 + 0.001:.3f}"
    rows = recording_of(deeper, line.replace("SECONDS", seconds)).trials()
    last = rows.loc[rows["stop_ms"].idxmax()]
    assert last["scene_off_ns"] > last["scene_on_ns"] + 1e6 * last["stop_ms"]
    assert not np.isnan(last["stop_distance_m"])


def test_gaze_follows_a_walker_and_is_measured_on_the_head_as_it_is_drawn(tmp_path):
    across = {"motion": "walk", "distance_m": 3, "bearing_deg": 25, "turn_deg": 70}
    line = 'yield t.show(Scene("person", **WALK, bearing_deg=25, turn_deg=70), 4)'
    recording = recording_of(tmp_path, line)
    targets = recording.stream_arrays("gaze_targets")
    t_ns, angle_deg = targets["t_sample_ns"], targets["angle_deg"][:, 0]
    onsets_ns = [p["start_ns"] for p in recording.events_named("shown", 1)["payload"]]
    near = []
    for start_ns, (_, row) in zip(onsets_ns, recording.trials().iterrows(), strict=True):
        walker = staged(start_ns, speed_mps=1.0, **across)
        is_late = (row["scene_on_ns"] + 1.5e9 < t_ns) & (t_ns < row["scene_off_ns"])
        late = np.flatnonzero(is_late & targets["valid"])
        near.append(angle_deg[late] < targets["radius_deg"][late, 0] + 3.0)
        for i in late[::20]:
            picture = picture_of(replace(walker, t_ns=int(t_ns[i])))
            people = picture.people
            head_m = look_of(picture.cast[0], people.root_m[0], people.orientation_wxyz[0])[0]
            towards = head_m - targets["origin_world_m"][i]
            cosine = towards @ targets["direction_world"][i] / np.linalg.norm(towards)
            expected_deg = float(np.degrees(np.arccos(min(1.0, cosine))))
            assert expected_deg == pytest.approx(angle_deg[i], abs=0.1)
    assert np.concatenate(near).mean() > 0.2  # by then they are far from where they set out
    again = targets_again(recording, opened(tmp_path, [line]).views_of, 1)
    assert targets["hit"].tolist() == again["hit"].tolist()
    assert targets["angle_deg"] == pytest.approx(again["angle_deg"], nan_ok=True)


@pytest.fixture(scope="module")
def older(tmp_path_factory):
    """A session of a walker as versions before recorded it, and its study."""
    folder = tmp_path_factory.mktemp("older")
    study = opened(folder, ['yield t.show(Scene("person", **WALK, eyes="directed"), 3)'])
    config = lab_in(folder, EXAMPLE)
    experiment = replace(study.experiment({}), heads_move=False)
    about = simulated_request(study, experiment, config, label="S01", index=0, seed=1)
    return Recording(perform_new(about)), study


def heads_of_scenes(recording):
    return {about.get("heads_move") for about in recording.events_named("scene", 1)["payload"]}


def test_a_recording_says_that_heads_moved_and_older_ones_say_nothing(tmp_path, older):
    recording = recording_of(tmp_path, 'yield t.show(Scene("person", **WALK), 1)')
    assert {None, True} == heads_of_scenes(recording)  # the dark has no heads
    study = opened(tmp_path, ['yield t.show(Scene("person", **WALK), 1)'])
    assert not study.took_heads_at_onset(recording, 1)
    recording, study = older
    assert {None} == heads_of_scenes(recording)
    assert study.took_heads_at_onset(recording, 1)


def test_an_older_recording_is_evaluated_with_heads_where_they_were_at_the_onset(older):
    recording, study = older
    again = targets_again(recording, study.views_of, 1)
    targets = recording.stream_arrays("gaze_targets")
    assert targets["hit"].tolist() == again["hit"].tolist()
    assert targets["angle_deg"] == pytest.approx(again["angle_deg"], nan_ok=True)
    assert HEADS_AT_ONSET in study.measure(recording).facts["latency"]


def test_an_older_simulated_session_is_performed_again_bit_for_bit(older, tmp_path):
    recording, study = older
    assert None is verify(recording, study, load_config(EXAMPLE), tmp_path).first
