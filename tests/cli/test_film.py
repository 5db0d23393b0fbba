"""Films of recorded trials: every camera, the participant in it, decisions to film by again."""

import json
import stat
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest
from PIL import Image
from typer.testing import CliRunner

from tests.sessions import opened, perform
from tests.stage import figures
from visavis.cli.app import app
from visavis.cli.film.cameras import CameraKind, FollowCamera, ViewpointCamera, camera_for
from visavis.cli.film.film import FilmedTrial, pictures_of
from visavis.cli.film.on_page import FilmPictures, film_share, page_picture
from visavis.cli.film.stand_in import StandIn
from visavis.cli.notifier import Forecast
from visavis.cli.preview.pictures import Viewpoint, add_label
from visavis.cli.recorded_trial import recorded_trial, trial_row
from visavis.cli.redraw import board_at
from visavis.cli.session_lanes import lanes_of
from visavis.lab.errors import DesignError, UsageError
from visavis.lab.geometry import Pose, quat_conjugate, rotate
from visavis.protocol.people.exports_register import registered_exports
from visavis.recording.cached import CachedRecording
from visavis.recording.folder import study_dir
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.page.seen_trial import Question, SeenStep, seen_trial
from visavis.running.sessions.study_folder import settle, wanted_settings
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, Renderer
from visavis.stimuli.camera.sheet import FilmLog
from visavis.stimuli.dressing.picture_of import NOBODY, picture_of
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import Picture, Room
from visavis.stimuli.surfaces import Surfaces
from visavis.study.films import Film
from visavis.study.parts import Posture
from visavis.study.scenes import Scene

HIPS = ("left_upper_leg", "right_upper_leg")
HEIGHTS = ("hips", "left_lower_leg", "left_foot", "left_eye")
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("film")
    study = opened("duel")
    settings_at = study_dir(folder, study.name, is_simulated=True)
    settle(settings_at, wanted_settings(settings_at, study, is_simulated=True), seed_given=False)
    return perform("duel", folder, repetitions=1, practice=0).path


def filmed(session: Path, video: Path, *options: str) -> Any:
    try:
        Renderer(quality=LIGHTEST).close()
    except StageError as problem:
        pytest.skip(str(problem))
    few = ("--seconds", "0.5", "--rate", "4", "--size", "160x90", "--trial", "T01")
    return CliRunner().invoke(app, ["film", str(session), "-o", str(video), *few, *options])


def test_a_film_by_the_topology_camera_is_cut_again_from_its_decisions(
    session: Path, tmp_path: Path
) -> None:
    first, again = tmp_path / "a.avi", tmp_path / "b.avi"
    done = filmed(session, first, "--shot", "full", "--camera", "topology")
    assert done.exit_code == 0, done.output
    decided = json.loads((tmp_path / "a.json").read_text())
    assert ["start"] == [cut["reason"] for cut in decided["cuts"]]
    assert (2, 7) == np.array(decided["views"]).shape
    done = filmed(session, again, "--camera", str(tmp_path / "a.json"))
    assert done.exit_code == 0, done.output
    assert first.read_bytes() == again.read_bytes()
    exports = registered_exports(session.parents[1])
    assert [["a.avi", "a.json"], ["b.avi"]] == [[*e.files] for e in exports if e.where == tmp_path]
    assert all("film" == export.what and export.labels for export in exports)
    assert 0o600 == stat.S_IMODE(first.stat().st_mode)


@pytest.mark.parametrize("camera", ["follow", "eyes", "above", "orbit"])
def test_every_camera_films_a_session_in_which_nothing_was_drawn(
    camera: str, session: Path, tmp_path: Path
) -> None:
    done = filmed(session, tmp_path / "a.avi", "--camera", camera, "--overlay", "none")
    assert done.exit_code == 0, done.output
    assert b"AVI " == (tmp_path / "a.avi").read_bytes()[8:12]
    assert not (tmp_path / "a.json").exists()


def test_every_picture_says_that_nobody_took_part_and_the_verb_how_long_it_takes(
    session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[str] = []

    def keep(image: npt.NDArray[np.uint8], text: str) -> Image.Image:
        written.append(text)
        return add_label(image, text)

    monkeypatch.setattr("visavis.cli.film.film.add_label", keep)
    monkeypatch.setattr(Forecast, "line_after", lambda _, done, of: f"{of} take long" * (done == 1))
    for name, is_simulated in (("simulated", True), ("duel", False)):
        monkeypatch.setattr(CachedRecording, "is_simulated", is_simulated)
        written.clear()
        done = filmed(session, tmp_path / f"{name}.avi", "--camera", "eyes")
        assert 1 == done.output.count("2 take long"), done.output
        assert [name] * 2 == [text.split()[0] for text in written]


@pytest.mark.parametrize(
    ("option", "known"),
    [("--camera", "topology"), ("--shot", "medium"), ("--cuts", "static"), ("--overlay", "gaze")],
)
def test_what_there_is_not_is_refused_with_what_there_is(
    option: str, known: str, session: Path, tmp_path: Path
) -> None:
    video = str(tmp_path / "a.avi")
    command = ["film", str(session), "--trial", "T01", "-o", video, option, "sideways"]
    done = CliRunner().invoke(app, command)
    assert "sideways" in str(done.exception)
    assert known in str(done.exception)


def test_a_room_without_a_place_for_the_camera_names_other_cameras_and_leaves_no_file(
    session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nowhere(room: Any) -> Any:
        raise DesignError("no camera track was found in this place")

    monkeypatch.setattr("visavis.cli.film.cameras.prepare", nowhere)
    monkeypatch.setattr("visavis.cli.film.cameras._PLACES", {})
    done = filmed(session, tmp_path / "a.mp4", "--camera", "topology")
    assert isinstance(done.exception, UsageError)
    assert "--camera follow, eyes, above or orbit" in str(done.exception)
    assert [] == list(tmp_path.iterdir())
    monkeypatch.setattr("visavis.cli.film.film.posture_of", lambda eye_m: "standing")
    done = filmed(session, tmp_path / "a.avi")
    assert done.exit_code == 0, done.output
    assert "filmed by --camera orbit" in done.output
    assert ["a.avi"] == [path.name for path in tmp_path.iterdir()]


def test_a_film_goes_on_in_the_dark_where_no_camera_finds_a_place(
    session: Path, tmp_path: Path
) -> None:
    longer = ("--seconds", "20", "--rate", "1", "--camera", "topology")
    done = filmed(session, tmp_path / "a.avi", *longer)
    assert done.exit_code == 0, done.output  # the question is asked in the dark
    views = json.loads((tmp_path / "a.json").read_text())["views"]
    start_ns, end_ns = recorded_trial(CachedRecording(session), "T01").span_ns
    assert 0 < len(views) < (end_ns - start_ns) / 1e9


def test_a_question_in_the_dark_is_in_the_film_by_any_camera(session: Path) -> None:
    recording = CachedRecording(session)
    (told,) = (
        told
        for told in recording.events_named("answered", 1)["payload"]
        if told["trial_id"] == "T01"
    )
    study = opened("duel")
    board = board_at(recording, study, 1, told["asked_ns"])
    assert board is not None
    assert (9, None) == (len(board.choices), board.chosen)
    marked = board_at(recording, study, 1, told["answered_ns"])
    assert marked is not None
    assert told["answer"] == marked.choices[marked.chosen or 0]
    assert board_at(recording, study, 1, told["asked_ns"] - 1) is None
    try:
        renderer = Renderer(quality=LIGHTEST)
    except StageError as problem:
        pytest.skip(str(problem))
    trial = recorded_trial(recording, "T01")
    with renderer:
        scene = FilmedTrial(
            trial,
            pictures_of(study, trial),
            ViewpointCamera(Viewpoint.ABOVE, 16 / 9, 0),
            (),
            (160, 90),
            FilmLog(None),
        )
        seen = next(scene.pictures([told["answered_ns"]], renderer.image))
    assert seen.max() > 100


def test_who_stands_in_has_the_eyes_where_the_headset_was(session: Path) -> None:
    recording = CachedRecording(session)
    trial = recorded_trial(recording, "T01")
    t_ns = trial.span_ns[0]
    picture = picture_of(next(iter(opened("duel").views_of(trial.shown_at(t_ns)))))
    head = Pose(np.array([0.3, 1.62, 1.1]), LEVEL)
    found = StandIn(trial).in_picture(picture, t_ns, head)
    assert len(picture.cast) + 1 == len(found.cast)
    assert found.cast[-1].name not in {c.name for c in picture.cast}
    skeleton, people = found.cast[-1].skeleton, found.people
    placed = forward(skeleton, people.root_m[-1], people.orientation_wxyz[-1])
    eyes = placed.position_m[[skeleton.index("left_eye"), skeleton.index("right_eye")]].mean(axis=0)
    assert np.abs(eyes - head.position_m)[[0, 2]].max() < 1e-6
    assert abs(eyes[1] - head.position_m[1]) < 0.06


@pytest.mark.parametrize(
    ("posture", "eye_m", "tall_m", "hips_m"),
    [
        ("seated", 1.2, (1.5, 2.0), (0.3, 0.75)),
        (None, 1.2, (1.5, 2.0), (0.3, 0.75)),
        ("seated", 0.9, (1.0, 1.5), (0.2, 0.6)),
        ("seated", 1.6, (1.5, 2.4), (0.6, 1.2)),
        ("standing", 1.2, (1.2, 1.4), (0.55, 0.75)),
        (None, 1.6, (1.65, 1.75), (0.8, 1.0)),
    ],
)
def test_who_was_filmed_sits_or_stands_as_the_study_declares(
    posture: Posture | None,
    eye_m: float,
    tall_m: tuple[float, float],
    hips_m: tuple[float, float],
    session: Path,
) -> None:
    trial = recorded_trial(CachedRecording(session), "T01")
    t_ns = trial.span_ns[0]
    picture = picture_of(next(iter(opened("duel").views_of(trial.shown_at(t_ns)))))
    head = Pose(np.array([0.3, eye_m, 1.1]), LEVEL)
    found = StandIn(trial, posture).in_picture(picture, t_ns, head)
    character, people = found.cast[-1], found.people
    placed = forward(character.skeleton, people.root_m[-1], people.orientation_wxyz[-1])
    height = {name: placed.position_m[character.skeleton.index(name)][1] for name in HEIGHTS}
    assert tall_m[0] < character.stature_m < tall_m[1]
    assert hips_m[0] < height["hips"] < hips_m[1]
    assert 0 < height["left_foot"] < 0.25
    assert abs(height["left_eye"] - eye_m) < 0.07
    sits = posture == "seated" or (posture is None and eye_m < 1.35)
    assert sits == (height["hips"] - height["left_lower_leg"] < 0.3)


@pytest.mark.parametrize("eye_m", [0.9, 1.2, 1.3])
def test_who_sits_is_filmed_on_one_chair_that_stays(eye_m: float, session: Path) -> None:
    trial = recorded_trial(CachedRecording(session), "T01")
    t_ns = trial.span_ns[0]
    picture = picture_of(next(iter(opened("duel").views_of(trial.shown_at(t_ns)))))
    person = StandIn(trial, "seated")
    heads = [Pose(np.array([0.3 + sway_m, eye_m, 1.1]), LEVEL) for sway_m in (0.0, 0.02)]
    first, later = (person.in_picture(picture, t_ns, head) for head in heads)
    assert first.room is later.room
    cushion, _ = (prop for prop in first.room.props if prop not in picture.room.props)
    character, people = first.cast[-1], first.people
    body = forward(character.skeleton, people.root_m[-1], people.orientation_wxyz[-1])
    places = {n: body.position_m[character.skeleton.index(n)] for n in (*HIPS, "left_lower_leg")}
    hips_m = (places[HIPS[0]] + places[HIPS[1]]) / 2
    apart_m = hips_m - cushion.mesh.vertices_m.mean(axis=0)
    assert abs(apart_m[0]) < 0.03
    assert -0.1 < apart_m[2] < 0.15  # the mean of seat and back is behind the seat's middle
    seat_m = np.sort(cushion.mesh.vertices_m[:, 1])[len(cushion.mesh.vertices_m) // 2 - 1]
    assert 0.05 < hips_m[1] - seat_m < 0.15


def test_who_stands_or_has_a_chair_in_the_room_is_given_none(session: Path) -> None:
    trial = recorded_trial(CachedRecording(session), "T01")
    t_ns = trial.span_ns[0]
    picture = picture_of(next(iter(opened("duel").views_of(trial.shown_at(t_ns)))))
    head = Pose(np.array([0.3, 1.2, 1.1]), LEVEL)
    assert picture.room is StandIn(trial, "standing").in_picture(picture, t_ns, head).room
    furnished = StandIn(trial, "seated").in_picture(picture, t_ns, head).room
    again = replace(picture, room=furnished)
    assert furnished is StandIn(trial, "seated").in_picture(again, t_ns, head).room


def came_along(name: str) -> OpenedStudy:
    found = find_study(name)
    assert isinstance(found, OpenedStudy)
    return found


def test_studies_that_come_along_declare_the_posture_of_their_source() -> None:
    declared = {n: came_along(n).study.procedure.posture for n in ("stare", "waving", "crowd")}
    assert {"stare": "seated", "waving": "standing", "crowd": "standing"} == declared


def test_gaze_is_drawn_as_far_as_the_surface_it_met(session: Path) -> None:
    trial = recorded_trial(CachedRecording(session), "T01")
    assert trial.gaze is not None
    start_ns, end_ns = trial.span_ns
    t_ns, hit = trial.gaze["t_sample_ns"], trial.gaze["hit"]
    inside = (t_ns >= start_ns) & (t_ns < end_ns) & trial.gaze["valid"]
    assert (np.diff(t_ns) >= 0).all()  # also where the tracker's clock slipped
    met = int(np.flatnonzero(inside & (hit >= 0))[0])
    shown = trial.shown_at(int(t_ns[met]))
    ray = trial.gaze_at(int(t_ns[met]))
    assert ray is not None
    head = shown.scene.agents[hit[met]]
    view = next(iter(opened("duel").views_of(shown)))
    end_m = ray[0] + Surfaces().end_m(picture_of(view), *ray) * ray[1]
    assert 1.5 * head.head_radius_m > np.linalg.norm(end_m - head.head_centre_m)


@pytest.fixture(scope="module")
def on_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page")
    study = opened("films")
    settings_at = study_dir(folder, study.name, is_simulated=True)
    settle(settings_at, wanted_settings(settings_at, study, is_simulated=True), seed_given=False)
    return perform("films", folder).path


def test_a_trial_on_a_page_is_led_again_through_what_was_on_the_page(on_page: Path) -> None:
    recording = Recording(on_page)
    row = trial_row(recording, "T01")
    seen = seen_trial(opened("films"), recording, row)
    first, pair, effort = seen.steps
    assert "" == seen.problem
    assert (["film"], ["left", "right"], []) == (
        list(first.films),
        list(pair.films),
        list(effort.films),
    )
    assert (row["film_on_ns"], row["film2_on_ns"]) == (first.films_on_ns, pair.films_on_ns)
    wanted = [str(row["lively"]), row["livelier"], row["effort_typed"]]
    assert wanted == [step.questions[0].answer for step in seen.steps]
    assert row["motion"] == pair.films["left"].scene.options["motion"]
    assert seen.step_at(pair.films_on_ns) is pair
    once_ns = pair.films_on_ns + round(1e9 * (0.5 + 0.2))
    assert pytest.approx(0.2) == pair.film_time_s(pair.films["left"], once_ns)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_questions_below_a_film_leave_room_for_the_line_that_says_what_it_is(n: int) -> None:
    low = np.array([0, 255, 0])

    def film(*_: object) -> npt.NDArray[np.uint8]:
        return np.full((round(film_share(n) * 540), 400, 3), low, np.uint8)

    question = Question("q", "Which?", (("a", "left"), ("b", "right")), None, None)
    shown = Film(Scene("person"), 1.0, (400, 300), 10)
    step = SeenStep(0, 10**9, 0, {"film": shown}, "", (question,) * n)
    films = cast(FilmPictures, SimpleNamespace(at=film))
    page = page_picture(step, 1, films, (960, 540))
    assert n * 0.1 * 540 < 540 - np.flatnonzero((page == low).all(axis=2).any(axis=1))[-1]
    assert (page[-25:] == page[-1, -1]).all()


def test_a_film_of_a_page_shows_its_films_in_time_and_marks_the_answer(
    on_page: Path, tmp_path: Path
) -> None:
    done = filmed(on_page, tmp_path / "a.mp4")
    assert done.exit_code == 0, done.output
    recording = Recording(on_page)
    seen = seen_trial(opened("films"), recording, trial_row(recording, "T01"))
    step = seen.steps[0]
    asked_for: list[tuple[int, int]] = []

    def image(picture: Any, camera: Any, size_px: tuple[int, int]) -> Any:
        asked_for.append(size_px)
        return np.zeros((size_px[1], size_px[0], 3), np.uint8)

    films = FilmPictures(replace(seen.store, folder=tmp_path), 90, image)
    begin, end = (
        page_picture(step, t_ns, films, (320, 180)) for t_ns in (step.films_on_ns, step.gone_ns - 1)
    )
    assert {(90, 90)} == set(asked_for)
    blue = (38, 104, 173)
    assert [False, True] == [bool((p == blue).all(axis=2).any()) for p in (begin, end)]


class Told:
    """A recording of nothing but events and the commands of a band."""

    stream_names = ("haptics_armband_left_forearm",)

    def events(self) -> pd.DataFrame:
        rows = [
            (1, 12, "contact_begin", {"role": "armband_left_forearm", "t_contact_ns": 10}),
            (1, 32, "contact_end", {"role": "armband_left_forearm", "t_contact_ns": 30}),
            (1, 40, "contact_begin", {"role": "armband_left_forearm", "t_contact_ns": 40}),
            (2, 5, "contact_begin", {"role": "armband_left_forearm", "t_contact_ns": 5}),
        ]
        return pd.DataFrame(rows, columns=["recording_part", "t_ns", "name", "payload"])

    def stream_arrays(self, name: str, *, part: int) -> dict[str, Any]:
        del name, part
        strengths = np.full((4, 4), np.nan, np.float32)
        strengths[:3, 0] = 0.5
        return {
            "t_commanded_ns": np.array([10, 50_000_000, 90_000_000, 95_000_000]),
            "kind": np.array([1, 3, 1, 2], np.uint8),
            "amplitudes_01": strengths,
            "duration_ms": np.array([20.0, 0.0, 100.0, 0.0], np.float32),
            "acknowledged": np.array([True, True, False, True]),
        }


def test_contacts_last_until_their_end_and_vibrations_until_the_next_command() -> None:
    contact, vibration = lanes_of(cast(Recording, Told()), 1)
    assert ("contact left forearm", "contact") == (contact.name, contact.kind)
    assert [(10, 30), (40, 40)] == [span[:2] for span in contact.spans]
    wanted = [(10, 20_000_010, "50 %"), (90_000_000, 95_000_000, "50 %, not acknowledged")]
    assert wanted == vibration.spans
    assert vibration.is_on(91_000_000)
    assert not vibration.is_on(200_000_000)


@pytest.mark.parametrize(
    ("posture", "has_places", "camera"),
    [
        ("seated", True, CameraKind.FOLLOW),
        ("seated", False, CameraKind.FOLLOW),
        ("standing", True, CameraKind.TOPOLOGY),
        ("standing", False, CameraKind.ORBIT),
    ],
)
def test_who_sits_is_filmed_over_the_shoulder_towards_what_they_look_at(
    posture: Posture, has_places: bool, camera: CameraKind
) -> None:
    assert camera is camera_for(posture, has_places=has_places)


@pytest.mark.parametrize(("wall_m", "behind_m"), [(9.0, 1.6), (0.9, 0.9)])
def test_the_camera_over_the_shoulder_stays_before_the_wall(wall_m: float, behind_m: float) -> None:
    wall = figures.plane("wall", (-4, 0, wall_m), (8, 0, 0), (0, 4, 0), (160, 160, 160))
    room = Room("walled", (wall,), (), np.full(3, 0.6), np.full(3, 0.6))
    head = Pose(np.array([0.0, 1.2, 0.0]), LEVEL)
    camera = FollowCamera(16 / 9).at(0, Picture(0, room, (), NOBODY), head)
    behind = float(camera.pose.position_m[2])
    assert 0.3 < behind <= behind_m
    assert behind == pytest.approx(1.6) or behind < wall_m - 0.2
    # Whoever is straight ahead is in the picture, and so is the head that looks at them.
    for place_m in (np.array([0.0, 1.2, -3.0]), head.position_m):
        seen = place_m - camera.pose.position_m
        own = rotate(quat_conjugate(camera.pose.orientation_wxyz), seen)
        assert own[2] < 0
        assert camera.left < own[0] / -own[2] < camera.right
        assert camera.bottom < own[1] / -own[2] < camera.top
