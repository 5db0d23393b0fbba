"""A film all around in a study: in step and heard, looked at where its areas are, drawn again,
measured from the recording alone, and gone on with after a session was cut off.
"""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from tests.sessions import request_in
from tests.study.test_audible_steps import with_sound
from visavis.cli.quick_tracker import tracker_of
from visavis.cli.redraw import redraw
from visavis.lab.clock import SimClock
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import DesignError, SessionAborted
from visavis.protocol.session.operator import UnattendedOperator
from visavis.recording.cached import CachedRecording
from visavis.results.flat_again import read_items_text
from visavis.results.opened_study import find_study
from visavis.running.film_store import film_store
from visavis.running.quick import quick_study
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.study.area_measures import areas_shown
from visavis.study.files_read import digests_of_files
from visavis.study.measures import SessionGaze, TrialRecord

pytest.importorskip("av")
from benchmarks.film_in_step import write_film
from tests.panoramic_film import RATE_HZ, number_ahead, write_film_around

STUDY = """
from visavis import Compare, Factor, Panorama, Rating, Study, looks_at, view_range

study = Study(
    "lake", "S", factors=[Factor("boat", ["left", "right"])], repetitions=1, calibrate=False,
    measures=[*looks_at("boat", "gull", pad_deg=1), view_range()],
    compare=[Compare("boat_dwell_ms", within="boat")],
)

@study.trial
def trial(t):
    yield t.show(Panorama("lake.mp4", areas=f"{t.boat}.yaml"))

@study.answer
def answer(seen, response, rng):
    return 1
"""
SHOW_LINE = STUDY[STUDY.index("yield") : STUDY.index("@study.answer")].strip()
PICTURES = 38
LASTS_S = PICTURES / RATE_HZ
LEFT = """
boat:
  keys: [{t_s: 0, ellipse: [-5, -5, 10, 10]}, {t_s: 3.6, ellipse: [-23, -5, 10, 10]}]
  salience: 40
gull:
  keys: [{frame: 0, rectangle: [-10, 12, 10, 10]}, {frame: 36, rectangle: [-28, 12, 10, 10]}]
  salience: 40
"""
"""They go five degrees a second to the left, one below and one above the horizon."""
RIGHT = LEFT.replace("[-5, -5", "[5, -5").replace("[-23,", "[23,")
RIGHT = RIGHT.replace("[-10,", "[0,").replace("[-28,", "[18,")
STILL = "boat: {rectangle: [0, 80, 1, 1]}\ngull: {rectangle: [3, 80, 1, 1]}\n"


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    return write_film_around(tmp_path_factory.mktemp("films") / "lake.mp4", PICTURES, is_heard=True)


def lake_study(folder, film, line=SHOW_LINE):
    shutil.copy(film, folder)
    (folder / "left.yaml").write_text(LEFT)
    (folder / "right.yaml").write_text(RIGHT)
    (folder / "lake.py").write_text(STUDY.replace(SHOW_LINE, line))
    return find_study(str(folder / "lake.py"))


def heard_request(folder, study, example, show="none"):
    request = request_in(folder, study, example, show)
    return replace(request, config=with_sound(request.config, folder))


@pytest.fixture(scope="module", params=[SCREEN_EXAMPLE, EXAMPLE], ids=["screen", "headset"])
def session(request, tmp_path_factory, film):
    folder = tmp_path_factory.mktemp("lake")
    study = lake_study(folder, film)
    recording = CachedRecording(perform_new(heard_request(folder, study, request.param)))
    # The analysis needs the recording alone: what the files say now does not count.
    for name in ("left", "right"):
        (folder / f"{name}.yaml").write_text(STILL)
    return study, recording, study.measure(recording).rows


def test_it_lasts_as_long_as_it_does_in_step_and_heard(session):
    _, _, rows = session
    lasts_s = (rows["stimulus_off_ns"] - rows["stimulus_on_ns"]) / 1e9
    assert LASTS_S == pytest.approx(lasts_s.to_numpy(), abs=0.05)
    assert {PICTURES} == set(rows["stimulus_film_pictures"])
    assert {0} == set(rows["stimulus_film_dropped"])
    apart_ms = (rows["stimulus_sound_on_ns"] - rows["stimulus_on_ns"]).abs() / 1e6
    assert (apart_ms < 50).all()


@pytest.mark.parametrize("example", [SCREEN_EXAMPLE, EXAMPLE], ids=["screen", "headset"])
def test_frames_were_lit_with_the_picture_that_was_due_and_are_drawn_again(tmp_path, film, example):
    study = lake_study(tmp_path, film, 'yield t.show(Panorama("lake.mp4", areas="left.yaml"), 0.6)')
    recording = CachedRecording(perform_new(heard_request(tmp_path, study, example, "offscreen")))
    frames = recording.stream_arrays("frames", part=1)
    (since_ns, _) = (p["moves_since_ns"] for p in recording.events_named("shown", 1)["payload"])
    for number in range(6):
        due_ns = since_ns + round((number + 0.5) / RATE_HZ * 1e9)
        k = np.searchsorted(frames["t_host_ns"], due_ns)
        frame = int(frames["frame_index"][k])
        image = redraw(study, recording, frame)[0]  # refuses what was not drawn then
        assert number == number_ahead(image[image.shape[0] // 2, image.shape[1] // 2])


def test_simulated_people_look_where_areas_are_at_the_time(session):
    _, recording, rows = session
    for row in rows.to_dict("records"):
        gaze = SessionGaze(recording).of_part(1).targets
        gaze = gaze.between(row["stimulus_on_ns"], row["stimulus_off_ns"])
        (around,) = areas_shown(TrialRecord(row, recording), "stimulus")
        x, _ = around.pixels_met(gaze.direction_world.astype(np.float64), gaze.t_ns)
        right_deg = (x / around.size_px[0] - 0.5) * 360
        t_s = (gaze.t_ns - row["stimulus_on_ns"]) / 1e9
        ahead_deg = 5 + 5 * t_s
        on_way = (t_s > 0.4) & (t_s < 1.8) & gaze.valid
        expected_deg = (ahead_deg if row["boat"] == "right" else -ahead_deg)[on_way]
        assert np.median(abs(right_deg[on_way] - expected_deg)) < 6
    dwell_ms = rows["boat_dwell_ms"] + rows["gull_dwell_ms"]
    assert (dwell_ms > 900).all()
    assert (dwell_ms <= 3600 + 17).all()  # after their last key they are gone


def test_power_lets_the_same_people_see_it(tmp_path, film):
    study = lake_study(tmp_path, film)
    rows = quick_study(study, study.experiment({}), tracker_of, [0], seed=1).trials
    assert (rows["boat_dwell_ms"] + rows["gull_dwell_ms"] > 300).all()


class CutOff(UnattendedOperator):
    """Nobody; after so many frames the process ends."""

    def __init__(self, frames):
        self._left = frames

    def poll(self):
        """Wait for the end."""
        self._left -= 1
        if not self._left:
            raise KeyboardInterrupt
        return ()


def test_a_session_that_was_cut_off_in_a_film_goes_on(tmp_path, film):
    study = lake_study(tmp_path, film)
    request = heard_request(tmp_path, study, EXAMPLE)
    with pytest.raises(SessionAborted):
        perform_new(replace(request, operator=CutOff(60)))
    path = next((tmp_path / "data").glob("simulated/lake/sub-*/ses-001"))
    recording = CachedRecording(perform_rest(replace(request, clock=SimClock()), path))
    assert 2 == len(recording.manifest.parts)
    rows = recording.trials().query("status == 'complete'")
    assert {PICTURES} == set(rows["stimulus_film_pictures"])
    assert ["left", "right"] == sorted(rows["boat"])


def test_a_film_is_heard_as_loud_as_asked_or_not_at_all(tmp_path, film):
    both = [
        lake_study(tmp_path, film, f'yield t.show(Panorama("lake.mp4", areas="left.yaml", {how}))')
        .experiment({})
        .audibles
        for how in ("level_db=-20", "is_heard=False")
    ]
    assert [[-20], []] == [[sound.level_db for sound in sounds] for sounds in both]


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ('yield t.show(Panorama("pond.mp4"))', r"there is no film .*pond\.mp4"),
        ('yield t.show(Panorama("flat.mp4"))', r"flat\.mp4 has 1280 × 720 .* twice as wide"),
        ('yield t.show(Panorama("small.mp4"))', "1280 pixels wide for an eye; .* 1920 at least"),
        ('yield t.show(Panorama("text.mp4"))', r"text\.mp4 is no film that can be read"),
        (
            'yield t.show(Panorama("lake.mp4", "top-bottom"))',
            'for each eye; .* With stereo="none" it would be',
        ),
        ('yield t.show(Panorama("a.png", level_db=-3), 1)', "a picture is not heard"),
        (
            'yield t.show(Panorama("lake.mp4", areas="late.yaml"))',
            "boat has a key frame at 5 s, outside its film of 3.8",
        ),
        (
            'yield t.show(Panorama("lake.mp4", areas="high.yaml"))',
            "at 1 s: area boat does not fit around",
        ),
    ],
)
def test_what_cannot_be_shown_is_named_at_plan(tmp_path, film, line, says):
    study = lake_study(tmp_path, film, line)
    write_film(tmp_path / "flat.mp4", 3, (1280, 720))
    write_film(tmp_path / "small.mp4", 3, (1280, 640))
    (tmp_path / "text.mp4").write_text("no film")
    key = "boat: {{keys: [{{t_s: 0, ellipse: [0, 0, 9, 9]}}, {{t_s: {}, ellipse: [0, {}, 9, 9]}}]}}"
    (tmp_path / "late.yaml").write_text(key.format(5, 0) + "\ngull: {ellipse: [0, 0, 1, 1]}")
    (tmp_path / "high.yaml").write_text(key.format(1, 88) + "\ngull: {ellipse: [0, 0, 1, 1]}")
    with pytest.raises(DesignError, match=says):
        _ = study.experiment({}).read


def test_a_page_refuses_it_by_name_with_the_way_out(tmp_path, film):
    with pytest.raises(
        DesignError, match=r"shows lake\.mp4 all around, .* not of films; .* monitor"
    ):
        film_store(lake_study(tmp_path, film).experiment({}))


def test_a_locked_plan_holds_the_film_and_its_areas(tmp_path, film):
    digests = digests_of_files(lake_study(tmp_path, film).experiment({}))
    assert {"lake.mp4", "left.yaml", "right.yaml"} <= set(digests)


def test_an_event_describes_pictures_around_as_before_and_films_alike():
    (again,) = read_items_text("(Panorama(file='a.mp4', stereo='none', yaw_deg=0.0, areas=''),)")
    assert again.is_film
    assert "Panorama(file='a.mp4', stereo='none', yaw_deg=0.0, areas='')" == repr(again)
