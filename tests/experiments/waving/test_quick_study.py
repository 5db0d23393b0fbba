"""What the quick path shows of a wave is that wave, whatever was kept of others before."""

from dataclasses import replace
from itertools import combinations

import pytest

from visavis.experiments.waving import quick_study
from visavis.experiments.waving.clips import Making, study_wave
from visavis.experiments.waving.perception import evidence_of, reach_view
from visavis.experiments.waving.quick_study import evidence_for, gaze_of, surroundings_sha256
from visavis.stimuli.dressing.office_view import eye_at
from visavis.stimuli.scenes.office import neighbour

AHEAD = Making(before_s=0.3, wave_s=0.6, increment=0.0)
STIMULI = [
    (technique, direction, "clerk_left", "place_4")
    for direction in ("self", "right")
    for technique in ("orientation", "warping")
]


@pytest.fixture(autouse=True)
def nothing_kept(tmp_path, monkeypatch):
    monkeypatch.setattr("visavis.lab.array_cache.user_cache_path", lambda *_, **__: tmp_path)
    evidence_for.cache_clear()
    yield
    evidence_for.cache_clear()


def fresh(stimulus, making):
    technique, direction, clerk, place = stimulus
    target = neighbour(place, direction).name
    waving = study_wave(clerk, target, technique, making).waving
    return evidence_of(waving, place, eye_at(place), gaze_of(waving, place, target))


def test_every_wave_is_seen_as_it_is_rendered_after_others_have_been_kept():
    for stimulus in STIMULI:
        seen = evidence_for(stimulus, AHEAD)
        for name, expected in vars(fresh(stimulus, AHEAD)).items():
            assert expected.tolist() == getattr(seen, name).tolist(), (stimulus, name)


def test_waves_of_other_headings_have_other_hashes():
    places = ("place_2", "place_3", "place_4")
    turned = [study_wave("clerk_left", place, "orientation", AHEAD) for place in places]
    for one, other in combinations(turned, 2):
        assert one.waving.heading_deg != other.waving.heading_deg
        assert one.sha256 != other.sha256


def test_what_was_kept_is_not_that_of_another_light(monkeypatch):
    def dimmed(clerk, place):
        view = reach_view(clerk, place)
        return replace(view, lighting=view.lighting._replace(lamps=0.5 * view.lighting.lamps))

    lit = surroundings_sha256.__wrapped__()
    monkeypatch.setattr(quick_study, "reach_view", dimmed)
    assert lit != surroundings_sha256.__wrapped__()
