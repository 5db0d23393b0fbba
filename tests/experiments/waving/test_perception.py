"""What can be seen of a wave: pixels past furniture and people, from every place."""

import numpy as np
import pytest

from visavis.experiments.waving.clips import Making, study_wave
from visavis.experiments.waving.perception import CUE_PARTS, evidence_of, reach_of
from visavis.experiments.waving.quick_study import gaze_of
from visavis.stimuli.dressing.office_view import eye_at
from visavis.stimuli.scenes.office import CLERKS, CUSTOMERS, PARTICIPANT_PLACES

PLAIN = Making(wave_s=0.6, increment=0.0)


def seen(clerk, target, viewer):
    waving = study_wave(clerk, target, "orientation", PLAIN).waving
    return evidence_of(waving, viewer, eye_at(viewer), gaze_of(waving, viewer, target))


@pytest.fixture(scope="module")
def evidence():
    return seen("clerk_right", "place_3", "place_3")


def test_what_stands_in_between_only_takes_pixels_away(evidence):
    assert (evidence.pixels <= evidence.free).all()
    assert (evidence.pixels[1:] < evidence.free[1:]).any()
    assert 0 < evidence.visible_01 < 1


def test_every_cue_can_be_seen_where_nothing_stands_in_between(evidence):
    assert len(CUE_PARTS) == len(evidence.free)
    assert (evidence.free > 0).all()


def test_eyes_and_body_of_a_turned_clerk_point_at_the_addressee(evidence):
    target = evidence.bearing_deg[2]
    assert evidence.pointing_deg[:3] == pytest.approx(target, abs=4.0)


def test_bearings_of_places_grow_from_left_to_right(evidence):
    assert sorted(evidence.bearing_deg) == evidence.bearing_deg.tolist()


def test_every_place_sees_a_share(evidence):
    assert len(CUSTOMERS) == len(evidence.reach_01)
    assert ((evidence.reach_01 >= 0) & (evidence.reach_01 <= 1)).all()


def test_a_farther_clerk_covers_fewer_pixels():
    near, far = seen("clerk_left", "place_2", "place_2"), seen("clerk_left", "place_2", "place_4")
    assert far.free[1:].sum() < near.free[1:].sum()


@pytest.mark.parametrize("viewer", PARTICIPANT_PLACES)
def test_who_waves_is_never_hidden_but_in_part(viewer):
    """Of head and hand enough is seen to be judged, as the source has partial occlusion."""
    for clerk in CLERKS:
        one = seen(clerk.name, viewer, viewer)
        _, head, _, hand = one.pixels / one.free
        assert head > 0.3, clerk.name
        assert hand > 0.2, clerk.name


def test_the_right_of_the_line_sees_less_than_the_left():
    shares = np.mean(
        [
            reach_of(study_wave(c, "place_3", "orientation", PLAIN).waving)
            for c in ("clerk_left", "clerk_middle", "clerk_right")
        ],
        axis=0,
    )
    assert shares[3:].mean() < shares[:2].mean()
