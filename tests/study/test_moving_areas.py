"""Areas that move through a film: key frames are read, recorded, measured and looked at."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.film_in_step import RATE_HZ, write_film
from tests.sessions import request_in
from visavis.analysis.gaze.targets import GazeTargets
from visavis.cli.gaze_map import _outlines
from visavis.cli.quick_tracker import tracker_of
from visavis.cli.recorded_trial import recorded_trial
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Pose
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.quick import quick_study
from visavis.running.sessions.perform import perform_new
from visavis.stimuli.area_files import read_areas
from visavis.stimuli.areas import PlacedAreas, areas_text, read_areas_text
from visavis.stimuli.dressing.flat import areas_of
from visavis.stimuli.film_file import FilmFacts, film_facts
from visavis.stimuli.flat import Video
from visavis.stimuli.scenes.flat import FlatScene
from visavis.study.area_measures import looks_at, transitions
from visavis.study.measures import SessionGaze, TrialRecord

pytest.importorskip("av")

SIZE = (320, 180)
BALL = """
ball:
  keys:
    - {t_s: 0.5, rectangle: [0, 70, 40, 40]}
    - {t_s: 2.5, rectangle: [280, 70, 40, 40]}
wall: {rectangle: [0, 0, 320, 20]}
"""
"""A ball that rolls 140 pixels a second, for two seconds, under a wall that stands."""
SINCE_NS = 7_000_000_000
STEP_NS = 1_000_000


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_film(tmp_path_factory.mktemp("films") / "film.mp4", 3 * RATE_HZ)


def read(film: Path, text: str, name: str = "areas.yaml") -> Any:
    path = film.parent / name
    path.write_text(text, "utf-8")
    return read_areas(path, SIZE, film=film_facts(film))


def placed(film: Path, text: str, name: str = "areas.yaml") -> PlacedAreas:
    """Return areas of the film, 3.2 m wide at 2 m, that began at `SINCE_NS`; read from an event."""
    _ = read(film, text, name)
    video = Video(film.name, width_deg=2 * np.degrees(np.arctan(0.8)), areas=name)
    scene = FlatScene("flat", (), items=(video,), folder=film.parent, moves_since_ns=SINCE_NS)
    (one,) = read_areas_text(areas_text(areas_of(scene)))
    assert isinstance(one, PlacedAreas)
    return one


def measured(sheet: PlacedAreas, at_px: Any, measures: Any) -> dict[str, Any]:
    """Return the measures of gaze that is at a pixel at each time of the film in seconds."""
    t_ns = SINCE_NS + np.arange(0, 3_000_000_000, STEP_NS)
    gone_s = (t_ns - SINCE_NS) / 1e9
    direction = np.array([sheet.place_m(*at_px(t)) for t in gone_s])
    n = len(t_ns)
    samples = GazeTargets(
        t_ns=t_ns,
        valid=np.ones(n, np.bool_),
        direction_world=direction / np.linalg.norm(direction, axis=1, keepdims=True),
        angle_deg=np.zeros((n, 0)),
        radius_deg=np.zeros((n, 0)),
        pad_limit_deg=np.zeros((n, 0)),
        hit=np.full(n, -1, np.int16),
    )
    row = {"trial_id": "a", "stimulus_on_ns": SINCE_NS, "stimulus_off_ns": SINCE_NS + 3 * 10**9}
    row |= {"stimulus_frames": 180, "recording_part": 1}
    shown = {"trial_id": "a", "name": "stimulus", "areas": areas_text([sheet])}
    record = TrialRecord(row, None, samples, events=(("shown", shown),))
    return {m.column: m.of(record) for m in measures}


def test_gaze_that_waits_is_on_a_target_while_that_passes(film: Path) -> None:
    row = measured(placed(film, BALL), lambda t: (160, 90), looks_at("ball", "wall"))
    # its right edge comes to 160 at 0.5 + 120 / 140 s, its left edge at 0.5 + 160 / 140 s
    assert 1000 * 40 / 140 == pytest.approx(row["ball_dwell_ms"], abs=1.01)
    assert 1000 * (0.5 + 120 / 140) == pytest.approx(row["ball_first_look_ms"], abs=1.01)
    assert (1, 0) == (row["ball_entries"], row["wall_dwell_ms"])


def test_gaze_that_follows_a_target_is_on_it_from_its_first_key_to_its_last(film: Path) -> None:
    def middle(t_s: float) -> tuple[float, float]:
        return 20 + 140 * np.clip(t_s - 0.5, 0, 2), 90

    row = measured(placed(film, BALL), middle, looks_at("ball"))
    assert 2000 == pytest.approx(row["ball_dwell_ms"], abs=1.01)
    assert 500 == row["ball_first_look_ms"]


def test_a_pad_widens_a_target_where_it_is(film: Path) -> None:
    sheet = placed(film, BALL)
    far_deg = 10 * sheet.degrees_px(np.zeros(3))[0]
    row = measured(sheet, lambda t: (160, 90), looks_at("ball", pad_deg=far_deg))
    assert 1000 * 60 / 140 == pytest.approx(row["ball_dwell_ms"], abs=1.01)


def test_transitions_go_to_where_a_target_is(film: Path) -> None:
    row = measured(
        placed(film, BALL),
        lambda t: (160, 10) if t < 1.4 else (160, 90),
        transitions("wall", "ball"),
    )
    assert {"wall_to_ball": 1, "ball_to_wall": 0} == row


TABLE = """area,t_s,x,y
ball,0,10,10
ball,0,50,10
ball,0,50,50
ball,1,110,10
ball,1,150,10
ball,1,150,50
ball,1.5,,
ball,2,10,110
ball,2,50,110
ball,2,50,150
ball,3,10,110
ball,3,50,110
ball,3,50,150
wall,,0,0
wall,,9,0
wall,,9,9
"""


def test_a_table_tells_keys_by_its_time_and_an_empty_place_ends_an_area(film: Path) -> None:
    ball, wall = read(film, TABLE, "areas.csv")
    assert ((60.0, 10.0), (100.0, 10.0), (100.0, 50.0)) == ball.at(0.5).outline
    assert ball.at(1.0).outline == ball.at(1.4).outline
    assert (None, None) == (ball.at(1.5), ball.at(1.99))
    assert (10.0, 110.0) == ball.at(2.0).outline[0]
    assert wall is wall.at(2.0)


def test_frames_are_pictures_of_the_film_counted_from_nought(film: Path) -> None:
    first = "{frame: 30, ellipse: [50, 50, 20, 10]}"
    last = "{frame: 60, ellipse: [80, 50, 20, 20], turn_deg: 90}"
    (ball,) = read(film, f"ball: {{keys: [{first}, {last}], salience: 3}}")
    assert (65.0, 50.0, 20.0, 15.0, 45.0) == pytest.approx(ball.at(1.5).ellipse)
    assert (None, None) == (ball.at(0.99), ball.at(2.01))
    assert (3, True) == (
        ball.salience,
        bool(ball.holds(np.array([80.0]), np.array([50.0]), 2.0)[0]),
    )


def test_an_area_of_the_last_picture_stays_with_it(film: Path) -> None:
    keys = "[{t_s: 0, rectangle: [0, 0, 9, 9]}, {t_s: 3, rectangle: [0, 0, 9, 9]}]"
    sheet = placed(film, f"ball: {{keys: {keys}}}")
    assert None is not sheet.areas_now(SINCE_NS + 60 * 10**9)[0]
    assert (None,) == placed(film, BALL.partition("wall")[0]).areas_now(SINCE_NS + 60 * 10**9)


def test_the_areas_of_the_documentation_are_read(tmp_path: Path) -> None:
    page = Path(__file__).parents[2] / "docs" / "stimuli.md"
    (text,) = re.findall(r"```yaml\n(ball:.*?)```", page.read_text("utf-8"), re.DOTALL)
    (tmp_path / "large.yaml").write_text(text)
    facts = FilmFacts((640, 480), np.arange(150) / 30, 5.0, False, 0.0)
    ball, wall = read_areas(tmp_path / "large.yaml", (640, 480), film=facts)
    middles = [area and area.middle() for area in map(ball.at, (1.25, 2.5, 4.0))]
    assert [(220.0, 200.0), None, (600.0, 300.0)] == middles
    assert "wall" == wall.name


SQUARE = "rectangle: [0, 0, 9, 9]"
CORNERS = [[0, 0], [9, 0], [9, 9], [0, 9]]
ON_THE_WAY = "area ball turns inside out or crosses itself on the way from 1 to 2 s; give the same"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (f"[{{t_s: 0, {SQUARE}}}, {{t_s: 3.2, {SQUARE}}}]", "at 3.2 s, outside its film of 3 s"),
        (f"[{{t_s: -1, {SQUARE}}}, {{t_s: 3, {SQUARE}}}]", "at -1 s, outside its film"),
        (f"[{{frame: 0, {SQUARE}}}, {{frame: 90, {SQUARE}}}]", "no frame 90; 0 to 89"),
        (f"[{{t_s: 1, {SQUARE}}}, {{t_s: 1, {SQUARE}}}]", "go from 1 to 1 s"),
        (f"[{{t_s: 1, {SQUARE}}}]", "two key frames at least"),
        (
            f"[{{t_s: 1, {SQUARE}}}, {{t_s: 2, polygon: [[0, 0], [5, 0], [5, 5]]}}]",
            "ball is 4 corners at 1 s and 3 corners at 2 s",
        ),
        (
            f"[{{t_s: 1, {SQUARE}}}, {{t_s: 2, ellipse: [9, 9, 5, 5]}}]",
            "4 corners at 1 s and an ellipse at 2 s",
        ),
        (
            f"[{{t_s: 1, {SQUARE}}}, {{t_s: 2, rectangle: [300, 0, 40, 9]}}]",
            "at 2 s: area ball reaches to (340, 0), outside its picture",
        ),
        *(  # mirrored, begun at the opposite corner, and at the next one the other way round
            (f"[{{t_s: 1, {SQUARE}}}, {{t_s: 2, polygon: {other}}}]", ON_THE_WAY)
            for other in (
                [[x + 50, 9 - y] for x, y in CORNERS],
                CORNERS[2:] + CORNERS[:2],
                [[20, 20], [20, 30], [30, 30], [30, 20]],
            )
        ),
        (  # inside out from .33 to .43 of the way alone
            "[{t_s: 1, polygon: [[71, 23], [3, 30], [40, 13]]}, "
            "{t_s: 2, polygon: [[18, 6], [76, 69], [38, 69]]}]",
            ON_THE_WAY,
        ),
        (f"[{{t_s: 1, {SQUARE}}}, {{t_s: 2, frame: 3, {SQUARE}}}]", "its t_s or its frame"),
        (f"[{{{SQUARE}}}, {{t_s: 2, {SQUARE}}}]", "its t_s or its frame"),
        (f"[{{t_s: 1, {SQUARE}}}, {{t_s: soon, {SQUARE}}}]", "t_s is 'soon'; a number"),
        (f"[{{t_s: 1, {SQUARE}}}, {{t_s: 1{'0' * 400}, {SQUARE}}}]", "a number"),
        (f"[{{t_s: 1, {SQUARE}}}, {{t_s: 2}}]", "at 2 s one of polygon, rectangle, ellipse, gone"),
        (f"[{{t_s: 1, {SQUARE}}}, {{t_s: 2, mask: a.png}}]", "'mask'; known: ellipse, frame"),
        (
            f"[{{t_s: 1, {SQUARE}, turn_deg: 9}}, {{t_s: 2, {SQUARE}}}]",
            "turn_deg goes with ellipse",
        ),
        ("{t_s: 1}", "keys is a list of key frames"),
    ],
)
def test_what_is_wrong_with_keys_is_told_by_file_area_and_time(
    film: Path, text: str, says: str
) -> None:
    with pytest.raises(DesignError, match=r"areas\.yaml, line 1.*: .*area.* ball") as problem:
        read(film, f"ball: {{keys: {text}}}")
    assert says in str(problem.value)


def test_an_outline_may_turn_and_change_its_size_between_keys(film: Path) -> None:
    diamond = [[30, 20], [40, 30], [30, 40], [20, 30]]  # by an eighth of a turn
    pause = "{t_s: 1.5, gone: true}"
    mirror_image = "{t_s: 2, polygon: [[0, 9], [9, 9], [9, 0], [0, 0]]}, {t_s: 3, gone: true}"
    keys = f"{{t_s: 0, {SQUARE}}}, {{t_s: 1, polygon: {diamond}}}, {pause}, {mirror_image}"
    (ball,) = read(film, f"ball: {{keys: [{keys}]}}")
    assert (0.0, 9.0) == ball.at(2.5).outline[0]


def test_keys_of_a_table_are_told_by_their_line(film: Path) -> None:
    with pytest.raises(DesignError, match=r"line 6: .*at 9 s, outside its film"):
        read(film, TABLE.replace("ball,1,150,10", "ball,9,150,10"), "areas.csv")
    with pytest.raises(DesignError, match=r"line 7: area ball: a key frame lacks its time"):
        read(film, TABLE.replace("ball,1,150,50", "ball,,150,50"), "areas.csv")
    with pytest.raises(DesignError, match=r"line 7: area 'ball' begins a second time"):
        read(film, TABLE.replace("ball,1,150,50", "ball,0,150,50"), "areas.csv")


def test_a_picture_has_no_key_frames(film: Path) -> None:
    _ = read(film, BALL)
    with pytest.raises(DesignError, match=r"areas\.yaml, line 2: area ball .* for films: Video"):
        read_areas(film.parent / "areas.yaml", SIZE)


STUDY = """
from visavis import Compare, Factor, Rating, Study, Text, Video, gaze_on, looks_at

study = Study(
    "balls", "S", factors=[Factor("film", ["one", "two"])], calibrate=False,
    measures=[*looks_at("ball", "shadow")], compare=[Compare("ball_dwell_ms", within="film")],
)

@study.trial
def trial(t):
    yield t.show(Video("film.mp4", width_deg=30, areas=f"{t.film}.yaml"))
    yield t.ask(Rating("side", 1, 7))
    yield t.show(Video("film.mp4", width_deg=30, areas="one.yaml"), 3,
                 until=gaze_on("ball", 0.2), name="wait")

@study.answer
def answer(seen, response, rng):
    return 7 if seen.areas["ball"][0] > 0 else 1
"""
ONE = """
ball:
  keys: [{t_s: 0, rectangle: [10, 20, 100, 70]}, {t_s: 3, rectangle: [210, 20, 100, 70]}]
  salience: 60
shadow:
  keys: [{t_s: 0, rectangle: [10, 90, 100, 70]}, {t_s: 3, rectangle: [210, 90, 100, 70]}]
  salience: 60
"""
"""From the left to the right; gaze leaves the one for the other, as nothing else attracts."""
TWO = ONE.replace("[10,", "[x,").replace("[210,", "[10,").replace("[x,", "[210,")


def written(folder: Path, pictures: int) -> Any:
    write_film(folder / "film.mp4", pictures)
    (folder / "one.yaml").write_text(ONE)
    (folder / "two.yaml").write_text(TWO)
    (folder / "balls.py").write_text(STUDY)
    return find_study(str(folder / "balls.py"))


@pytest.fixture(scope="module", params=[SCREEN_EXAMPLE, EXAMPLE], ids=["screen", "headset"])
def session(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("balls")
    study = written(folder, 3 * RATE_HZ)
    about = request_in(folder, study, request.param)
    return study, Recording(perform_new(about))


def times_and_right_deg(recording: Any, row: Any) -> tuple[Any, Any]:
    """Return when gaze was usable in the first showing, and its degrees to the right."""
    part = SessionGaze(recording).of_part(1)
    assert part is not None
    gaze = part.targets.between(row["stimulus_on_ns"], row["stimulus_off_ns"])
    towards = gaze.direction_world[gaze.valid]
    right_deg = np.degrees(np.arctan2(towards[:, 0], -towards[:, 2]))
    return (gaze.t_ns[gaze.valid] - row["stimulus_on_ns"]) / 1e9, right_deg


def test_simulated_people_look_where_an_area_is_at_the_time(session: Any) -> None:
    _, recording = session
    for row in recording.trials().to_dict("records"):
        t_s, right_deg = times_and_right_deg(recording, row)
        early, late = (right_deg[(t_s > a) & (t_s < b)].mean() for a, b in ((0.5, 1.2), (2.2, 3.0)))
        assert (row["film"] == "one") == (early < late)


def test_a_session_is_measured_where_its_areas_were(session: Any) -> None:
    study, recording = session
    for name in ("one", "two"):  # what the files say now does not count
        (study.study.files.folder / f"{name}.yaml").write_text(
            "ball: {rectangle: [0, 0, 1, 1]}\nshadow: {rectangle: [2, 2, 1, 1]}"
        )
    rows = study.measure(recording).rows
    assert (rows["ball_dwell_ms"] + rows["shadow_dwell_ms"] > 800).all()


def test_people_know_where_an_area_was_when_they_are_asked(session: Any) -> None:
    rows = session[1].trials()
    assert {"one": {7}, "two": {1}} == {f: set(of["side"]) for f, of in rows.groupby("film")}


def test_gaze_on_an_area_that_moves_ends_a_step(session: Any) -> None:
    rows = session[1].trials()
    assert rows["wait_gaze_on_ns"].notna().any()


def test_a_map_outlines_an_area_where_it_was_in_the_picture_that_is_drawn(session: Any) -> None:
    _, recording = session
    row = next(row for row in recording.trials().to_dict("records") if row["film"] == "one")
    trial = recorded_trial(recording, row["trial_id"])
    ahead = Pose(np.array([0.0, 1.2, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    rights = []
    for t_s in (0.0, 1.5, 3.0):
        ((_, (corners,)), _) = _outlines(
            trial, "stimulus", ahead, row["stimulus_on_ns"] + round(t_s * 1e9)
        )
        rights.append(corners[:, 0].mean())
    assert rights[0] < -0.05 < rights[1] < 0.05 < rights[2]
    assert 0 == pytest.approx(rights[1], abs=0.005)


def test_power_lets_the_same_people_follow_it(tmp_path: Path) -> None:
    study = written(tmp_path, 3 * RATE_HZ)
    rows = quick_study(study, study.experiment({}), tracker_of, [0], seed=1).trials
    assert (rows["ball_dwell_ms"] + rows["shadow_dwell_ms"] > 800).all()


def test_a_time_outside_a_film_is_told_at_plan(tmp_path: Path) -> None:
    with pytest.raises(
        DesignError, match=r"one\.yaml.*ball has a key frame at 3 s, outside its film of 1"
    ):
        _ = written(tmp_path, RATE_HZ).experiment({}).read
