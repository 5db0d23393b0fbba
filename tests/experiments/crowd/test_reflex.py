"""What the bands are told the moment a body sample shows contact, and when they fall silent."""

import numpy as np
import pytest

from visavis.experiments.crowd.design import CrowdParameters
from visavis.experiments.crowd.haptics import BAND_ROLES, MOTORS
from visavis.experiments.crowd.reflex import ContactReflex
from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.clock import NS_PER_MS
from visavis.protocol.plan.steps import BodyView, Play, Silence
from visavis.stimuli.contact.idle import crowd_poses, people_of
from visavis.stimuli.scenes.station_crowd import ROOM_SIDE_M, station_crowd

CROWD = station_crowd(1)
STEP_NS = 10 * NS_PER_MS
QUIET_NS = 150 * NS_PER_MS
FAR_M = np.array([40.0, 0.0, 0.0])


def body_at(t_ns, *, away=False, lost=(), shift_m=0.0):
    """Return a sample of someone who stands exactly where person 0 stands, or far away."""
    position, turn = crowd_poses(people_of(CROWD)[:1], 0.0)
    position = position + (FAR_M if away else 0.0) + shift_m
    valid = np.ones((1, len(BODY_JOINTS)), bool)
    for name in lost:
        valid[0, BODY_JOINTS.index(name)] = False
        position[0, BODY_JOINTS.index(name)] = np.nan
    return BodyView(BODY_JOINTS, np.array([t_ns]), position, turn, valid)


def reflex(*, vibrates=True, moved=None, **parameters):
    return ContactReflex(
        CROWD, 0, QUIET_NS, CrowdParameters(**parameters), vibrates=vibrates, moved_segments=moved
    )


def swaying(k, *, held=(), since=0):
    """Return sample k of a body in contact that sways, but for segments held as they were."""
    body = body_at(k * STEP_NS, shift_m=1e-6 * k)
    last = body_at(k * STEP_NS, shift_m=1e-6 * min(k, since))
    for name in held:
        column = BODY_JOINTS.index(name)
        body.position_m[0, column] = last.position_m[0, column]
    return body


def test_every_band_whose_segment_touches_starts_the_pattern_at_once():
    steps = reflex().answer(body_at(STEP_NS))
    assert {step.role for step in steps} == set(BAND_ROLES)
    published = CrowdParameters().vibration
    assert (published.name, published.low_hz, published.high_hz) == ("sine", 57.0, 126.0)
    assert published.modulation_hz == 10.0
    assert all(step == Play(step.role, published, MOTORS) for step in steps)


def test_the_end_of_contact_silences_each_band():
    contact = reflex()
    contact.answer(body_at(STEP_NS))
    assert {Silence(r) for r in BAND_ROLES} == set(contact.answer(body_at(2 * STEP_NS, away=True)))


def test_lasting_contact_renews_the_pattern_before_it_runs_out_and_not_sooner():
    contact = reflex()
    answered = [
        t_ns
        for t_ns in range(STEP_NS, 250 * STEP_NS, STEP_NS)
        if contact.answer(body_at(t_ns, shift_m=1e-6 * (t_ns // STEP_NS)))
    ]
    assert answered == [STEP_NS, STEP_NS + 1850 * NS_PER_MS]


def test_samples_before_the_walk_command_nothing():
    assert reflex().answer(body_at(-STEP_NS)) == []


def test_the_sample_of_the_walks_first_moment_is_answered():
    assert 4 == len(reflex().answer(body_at(0)))


def test_a_gap_of_exactly_the_limit_is_no_silence_and_a_longer_one_is_all_silence():
    contact = reflex()
    contact.answer(body_at(0))
    contact.answer(body_at(QUIET_NS, shift_m=1e-6))
    assert 0.0 == contact.account()[0]["body_silent_ms"]
    contact.answer(body_at(2 * QUIET_NS + 1, shift_m=2e-6))
    columns, flags = contact.account()
    assert (QUIET_NS + 1) / NS_PER_MS == columns["body_silent_ms"]
    assert ["body_silent"] == flags


def test_a_walk_that_ends_exactly_at_the_limit_of_silence_was_not_silent():
    contact = reflex()
    contact.answer(body_at(0))
    contact.end(QUIET_NS)
    assert [] == contact.account()[1]


def test_a_pose_that_repeats_for_exactly_the_limit_is_believed():
    contact = reflex()
    contact.answer(body_at(0))
    contact.answer(body_at(QUIET_NS // 2))
    assert [] == contact.answer(body_at(QUIET_NS))
    assert [] == contact.account()[1]
    steps = contact.answer(body_at(QUIET_NS + 1))
    assert {Silence(role) for role in BAND_ROLES} == set(steps)
    assert ["body_frozen"] == contact.account()[1]


@pytest.mark.parametrize("axis", [0, 2])
@pytest.mark.parametrize("side", [1, -1])
def test_hips_on_the_rooms_edge_are_in_the_room_and_beyond_it_outside(axis, side):
    def outside(at_m):
        body = body_at(STEP_NS)
        body.position_m[0, BODY_JOINTS.index("hips"), axis] = side * at_m
        contact = reflex()
        contact.answer(body)
        return contact.account()[0]["outside_room_samples"]

    assert 0 == outside(ROOM_SIDE_M / 2)
    assert 1 == outside(np.nextafter(ROOM_SIDE_M / 2, 99.0))


def test_a_tracker_that_repeats_itself_silences_and_is_counted():
    contact = reflex()
    steps = [contact.answer(body_at(k * STEP_NS)) for k in range(1, 20)]
    assert len(steps[0]) == 4
    silent = [k for k, some in enumerate(steps) if any(isinstance(s, Silence) for s in some)]
    assert silent == [16]
    columns, flags = contact.account()
    assert flags == ["body_frozen"]
    assert columns["body_frozen_ms"] == pytest.approx(30.0)


def test_a_tracker_that_falls_silent_silences_the_bands():
    contact = reflex()
    contact.answer(body_at(STEP_NS))
    assert contact.look_after(STEP_NS + QUIET_NS) == []
    assert len(contact.look_after(STEP_NS + QUIET_NS + 1)) == 4
    contact.end(STEP_NS + 400 * NS_PER_MS)
    columns, flags = contact.account()
    assert flags == ["body_silent"]
    assert columns["body_silent_ms"] == pytest.approx(400.0)


def test_a_lost_segment_touches_nothing_and_is_counted():
    contact = reflex()
    steps = contact.answer(body_at(STEP_NS, lost=("left_upper_arm",)))
    assert "armband_left_upper_arm" not in {step.role for step in steps}
    assert contact.account()[0]["body_part_lost_samples"] == 1


def test_a_walk_that_ends_in_contact_ends_silent():
    contact = reflex()
    contact.answer(body_at(STEP_NS))
    assert {Silence(role) for role in BAND_ROLES} == set(contact.end(2 * STEP_NS))
    assert contact.end(3 * STEP_NS) == []


def test_without_vibration_contacts_are_noted_and_nothing_is_commanded():
    contact = reflex(vibrates=False)
    assert contact.answer(body_at(STEP_NS)) == []
    assert {order.role for order in contact.take_orders()} == set(BAND_ROLES)
    assert contact.take_orders() == []


def test_the_nearest_motor_alone_is_driven_where_that_is_chosen():
    steps = reflex(nearest_motor=True).answer(body_at(STEP_NS))
    assert len(steps) == 4
    assert all(len(step.motors) == 1 and step.motors[0] in MOTORS for step in steps)


def test_a_slow_link_looks_only_four_times_a_second():
    contact = reflex(haptic_update_hz=4.0)
    assert contact.answer(body_at(STEP_NS, away=True)) == []
    assert contact.answer(body_at(2 * STEP_NS)) == []
    assert len(contact.answer(body_at(26 * STEP_NS, shift_m=1e-6))) == 4


def test_a_slow_link_renews_the_pattern_at_the_last_look_before_its_end():
    contact = reflex(haptic_update_hz=4.0)
    asked = [
        step_ns
        for step_ns in range(0, 5000 * NS_PER_MS, STEP_NS)
        if contact.answer(body_at(step_ns, shift_m=1e-6 * (step_ns // STEP_NS)))
    ]
    gaps_ms = np.diff(asked) / NS_PER_MS
    assert len(gaps_ms) > 1
    assert (gaps_ms < CrowdParameters().vibration.duration_ms).all()


def test_a_tracker_that_repeats_itself_with_a_hand_lost_silences_too():
    contact = reflex()
    for k in range(1, 20):
        contact.answer(body_at(k * STEP_NS, lost=("left_hand",)))
    assert {"body_frozen", "body_part_lost"} == set(contact.account()[1])
    assert {"end"} == {order.kind for order in contact.take_orders()[-4:]}


def test_arms_that_are_lost_altogether_are_lost_and_not_frozen():
    contact = reflex()
    arms = [name for name in BODY_JOINTS if "arm" in name or "hand" in name]
    for k in range(1, 40):
        contact.answer(body_at(k * STEP_NS, lost=arms))
    assert ["body_part_lost"] == contact.account()[1]


def test_a_walk_without_any_sample_says_so():
    columns, flags = reflex().account()
    assert flags == ["body_never_tracked"]
    assert columns["body_samples"] == 0
    assert columns["body_silent_ms"] is None
    assert columns["frozen_segments"] is None


def test_a_segment_that_repeats_its_last_pose_touches_nothing_and_is_named():
    contact = reflex()
    for k in range(1, 400):
        contact.answer(swaying(k, held=("left_upper_arm",), since=30))
    ordered = [
        (o.kind, o.t_contact_ns // STEP_NS) for o in contact.take_orders() if "left_upper" in o.role
    ]
    assert [("begin", 1), ("end", 46)] == ordered
    contact.end(400 * STEP_NS)
    columns, flags = contact.account()
    assert ["segment_frozen"] == flags
    assert "left_upper_arm=3540" == columns["frozen_segments"]


def test_a_body_that_sways_has_no_frozen_segment():
    contact = reflex()
    for k in range(1, 400):
        contact.answer(swaying(k))
    columns, flags = contact.account()
    assert [] == flags
    assert "" == columns["frozen_segments"]


def test_a_segment_that_died_in_the_walk_before_is_not_believed_in_this_one():
    moved = set()
    before = reflex(moved=moved)
    for k in range(1, 40):
        before.answer(swaying(k))
    before.end(40 * STEP_NS)
    contact = reflex(moved=moved)
    for k in range(1, 40):
        contact.answer(swaying(k, held=("left_hand",)))
    assert ["segment_frozen"] == contact.account()[1]
    never_moved = reflex()
    for k in range(1, 40):
        never_moved.answer(swaying(k, held=("left_hand",)))
    assert [] == never_moved.account()[1]
