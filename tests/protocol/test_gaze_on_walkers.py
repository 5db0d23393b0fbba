"""Gaze on the head of somebody who moves is measured where the head is at the time."""

from dataclasses import replace

import numpy as np
import pytest

from tests.protocol.test_observation import EYE, observer
from visavis.devices.contracts import GAZE
from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg, unit
from visavis.lab.schema import SampleBatch, empty_values
from visavis.stimuli.dressing.office import look_of
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.moving_heads import STEP_NS, agents_at, moving_heads
from visavis.study.dry_run import still_view
from visavis.study.scenes import FOLLOW_STEP_M, Scene, Staging, stage

ONSET_NS = 7 * NS_PER_S
TIMES_NS = ONSET_NS + np.array([0, 1_234_567_890, 2_500_000_000])


def staged(**options):
    return stage(Scene("person", **options), Staging(np.random.default_rng(1), 8.0, ONSET_NS), {})


def drawn_heads_m(scene, t_ns):
    """Return where the heads (n, 3) of a scene are in the picture of a time."""
    frame = replace(staged(motion="walk").frame(still_view(), 0), scene=scene, t_ns=t_ns)
    picture = picture_of(frame)
    people = picture.people
    return np.array(
        [
            look_of(one, root_m, turns)[0]
            for one, root_m, turns in zip(
                picture.cast, people.root_m, people.orientation_wxyz, strict=True
            )
        ]
    )


def gaze_at(points_m, t_ns):
    values = empty_values(GAZE, len(t_ns))
    values["direction_head"] = unit(points_m - EYE)
    values["valid"] = True
    return SampleBatch(GAZE, np.arange(len(t_ns)), t_ns, t_ns, values)


def seen_of(scene, batch):
    seen, _, _ = observer(scene)
    seen.heads.add_measured(0, Pose(EYE, quat_from_yaw_pitch_deg(0.0)))
    seen.take(batch)
    return seen.observe(1, int(batch.t_host_ns[-1]))


def test_gaze_late_in_a_walk_meets_the_head_where_it_is_then():
    scene = staged(motion="walk", distance_m=4.0, bearing_deg=20.0, turn_deg=60.0).scene
    heads_m = np.concatenate([drawn_heads_m(scene, t_ns) for t_ns in TIMES_NS.tolist()])
    view = seen_of(scene, gaze_at(heads_m, TIMES_NS))
    assert [0, 0, 0] == view.hit.tolist()
    assert np.zeros(3) == pytest.approx(view.angle_deg[:, 0], abs=0.05)
    far_m = np.linalg.norm(heads_m - EYE, axis=1)
    radius_deg = np.degrees(np.arcsin(scene.agents[0].head_radius_m / far_m))
    assert radius_deg == pytest.approx(view.radius_deg[:, 0], rel=1e-3)


def test_gaze_that_stays_where_a_head_was_meets_nobody():
    scene = staged(motion="walk", distance_m=4.0, turn_deg=90.0).scene
    first_m = np.repeat(drawn_heads_m(scene, ONSET_NS), 3, axis=0)
    assert [0, -1, -1] == seen_of(scene, gaze_at(first_m, TIMES_NS)).hit.tolist()


def test_between_two_poses_a_head_is_where_it_is_drawn():
    scene = staged(motion="walk", distance_m=4.0).scene
    heads = moving_heads(scene)
    t_ns = ONSET_NS + np.arange(30) * 97 * NS_PER_S // 1000 + STEP_NS // 2
    drawn_m = np.stack([drawn_heads_m(scene, t) for t in t_ns.tolist()])
    assert drawn_m == pytest.approx(heads.centres_m(t_ns), abs=5e-4)


def test_people_who_stay_in_their_place_are_measured_where_they_are_held():
    assert moving_heads(staged(motion="idle").scene) is None
    assert moving_heads(staged(motion="wave").scene) is not None


def test_agents_of_a_later_time_have_their_heads_there():
    scene = staged(motion="walk", distance_m=4.0).scene
    (agent,) = agents_at(scene, int(TIMES_NS[-1]))
    assert drawn_heads_m(scene, int(TIMES_NS[-1]))[0] == pytest.approx(
        agent.head_centre_m, abs=5e-4
    )


def looks_of(scene, t_ns, head_m=EYE):
    """Return the direction (3,) of the gaze that a scene shows at a time, and where eyes are."""
    view = still_view(t_ns)._replace(head=Pose(head_m, quat_from_yaw_pitch_deg(0.0)))
    frame = scene.frame(view, t_ns - ONSET_NS)
    (agent,) = agents_at(scene.scene, t_ns)
    return frame, agent.eye_centre_m


def test_eyes_that_look_at_the_observer_do_so_from_where_they_are():
    walker = staged(motion="walk", distance_m=6.0, turn_deg=5.0, eyes="directed")
    for t_ns in TIMES_NS.tolist():
        frame, eye_m = looks_of(walker, t_ns)
        assert unit(EYE - eye_m) == pytest.approx(frame.gaze_direction[0], abs=5e-3)
        assert float(np.linalg.norm(EYE - eye_m)) == pytest.approx(
            float(frame.gaze_distance_m[0]), abs=FOLLOW_STEP_M
        )


def test_an_averted_gaze_goes_along_with_whoever_walks():
    walker = staged(motion="walk", distance_m=4.0, eyes="averted")
    first, _ = looks_of(walker, ONSET_NS)
    later = walker.frame(still_view(int(TIMES_NS[-1])), int(TIMES_NS[-1]) - ONSET_NS) or first
    assert first.gaze_direction == pytest.approx(later.gaze_direction, abs=1e-12)


def test_frames_ahead_of_a_walker_are_those_that_come_one_by_one():
    one, ahead = (staged(motion="walk", distance_m=4.0, eyes="directed") for _ in range(2))
    t_ns = ONSET_NS + np.arange(200) * NS_PER_S // 90
    heads_m = EYE + np.linspace(0, 0.1, 200)[:, None] * np.array([1.0, 0.0, 0.0])
    pictures = ahead.ahead(t_ns.tolist(), t_ns - ONSET_NS, heads_m)
    frames = [looks_of(one, t, head)[0] for t, head in zip(t_ns.tolist(), heads_m, strict=True)]
    assert [frame is not None for frame in frames] == pictures.is_new.tolist()
    for i, frame in enumerate(frames):
        if frame is not None:
            assert frame.gaze_direction.tolist() == pictures.gaze_direction[i].tolist()
    assert 100 < sum(pictures.is_new.tolist())
    ahead.pass_frames(pictures, 200)
    assert np.array_equal(one.observer_m, ahead.observer_m)
