"""A film is named by what it shows, built once, and the same whenever it is built."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import av
import numpy as np
import numpy.typing as npt
import pytest
from scipy.ndimage import binary_erosion
from typer.testing import CliRunner

from tests.stage import figures
from visavis.cli.film.on_page import FilmPictures
from visavis.cli.main import app
from visavis.lab.clock import NS_PER_S
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import DataError, DesignError
from visavis.lab.geometry import Pose, Vector, quat_conjugate, rotate
from visavis.protocol.plan.experiment import no_progress
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.film_store import (
    ENCODING,
    FILM_QUALITY,
    FilmStore,
    film_drawing,
    film_store,
    require_roles_of_pages,
)
from visavis.running.page.seen_trial import seen_trial
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.running.sessions.session_request import Request, simulated_request
from visavis.stage.errors import StageError
from visavis.stimuli.characters.character import Material
from visavis.stimuli.dressing.picture_of import NOBODY, picture_of
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import (
    Camera,
    Light,
    Panel,
    Picture,
    PlacedProp,
    Prop,
    Room,
    StaticMesh,
)
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.surfaces import Surfaces
from visavis.study.films import Film, Following, Lens, Placed
from visavis.study.scenes import Scene

SEEN = """
from visavis import Factor, Study, Text, looks_at

study = Study("seen", factors=[Factor("ink", ["red", "green"])], on="browser", calibrate=False,
              LINES)

@study.trial
def trial(t):
    yield t.show({"word": Text("x", colour=t.ink)}, seconds=1, name="face")
"""
SHORT = Film(Scene("person", motion="wave"), 0.1, size_px=(64, 64), rate_hz=30)


def store(folder: Path) -> FilmStore:
    """Return a store in a folder."""
    return FilmStore({}, folder, folder)


@pytest.mark.parametrize(
    "other",
    [
        replace(SHORT, scene=Scene("person", motion="idle")),
        replace(SHORT, seconds=0.2),
        replace(SHORT, size_px=(96, 64)),
        replace(SHORT, lens=Lens(eye_m=(0.0, 1.3, 0.0))),
        replace(SHORT, lens=Following()),
        replace(SHORT, lens=Following(back_m=2.0)),
        replace(SHORT, scene=Scene("person", motion="wave", character="male_01")),
    ],
)
def test_whatever_changes_what_is_seen_changes_the_name(other: Film, tmp_path: Path) -> None:
    film_files = store(tmp_path)
    assert film_files.name_of(SHORT) == store(tmp_path).name_of(replace(SHORT))
    assert film_files.name_of(SHORT) != film_files.name_of(other)


def block(side_m: float) -> Prop:
    """Return a white triangle."""
    corners = np.array([[0, 0, 0], [side_m, 0, 0], [0, side_m, 0]], np.float32)
    normals = np.tile(np.array([0, 0, 1], np.float32), (3, 1))
    white = np.full((3, 3), 255, np.uint8)
    mesh = StaticMesh(corners, normals, white, np.array([[0, 1, 2]], np.int32))
    return Prop("block", mesh, Material("plaster", "cloth"))


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 4, 8])
def test_one_sees_the_inside_of_a_sleeve_and_not_the_wall_behind_it(number: int) -> None:
    """Where a ray meets a person, from either side, the film does not show what is behind."""
    experiment = find_study("interpolation").experiment({})
    film_files, film = film_store(experiment), experiment.films[number]
    pictures = list(film_files.pictures(film))
    shown = pictures[len(pictures) // 2]
    bare = replace(shown.room, props=(), background_srgb=(255, 0, 255))
    picture = replace(shown, room=bare)
    person = picture.cast[0]
    placed = forward(person.skeleton, picture.people.root_m[0], picture.people.orientation_wxyz[0])
    camera = film_files.cameras(film)[0]
    try:
        with film_drawing() as draw:
            for side in ("left", "right"):
                hand_m = placed.position_m[person.skeleton.index(f"{side}_hand")]
                near = looking_at(camera, hand_m, 0.035)
                image = draw(picture, near, (120, 120)).astype(int)
                is_behind = np.abs(image - (255, 0, 255)).sum(axis=2) < 12
                origin, rays = figures.rays(near, (120, 120))
                meets = np.isfinite(Surfaces().ends(picture, origin, rays).distance_m)
                inner = binary_erosion(meets.reshape(120, 120), iterations=2)
                assert 0.2 < inner.mean()
                assert 0.0005 > (is_behind & inner).mean()
    except StageError as problem:
        pytest.skip(str(problem))


def looking_at(camera: Camera, place_m: Vector, half: float) -> Camera:
    """Return a camera that shows only what is around a place."""
    own = rotate(quat_conjugate(camera.pose.orientation_wxyz), place_m - camera.pose.position_m)
    x, y = own[0] / -own[2], own[1] / -own[2]
    return replace(camera, left=x - half, right=x + half, bottom=y - half, top=y + half)


AHEAD = Pose(np.array([0.0, 1.0, -2.0]), np.array([1.0, 0.0, 0.0, 0.0]))
LAMP = Light("point", np.ones(3), np.array([0.0, 2.5, 0.0]))
ROOM = Room("bare", (block(1.0),), (LAMP,), np.full(3, 0.2), np.full(3, 0.1))
BARE = Picture(
    0,
    ROOM,
    (),
    NOBODY,
    moving=(PlacedProp(block(0.5), AHEAD),),
    panels=(Panel("Who?", ("a", "b"), AHEAD, (1.0, 0.5)),),
)
ASIDE = replace(AHEAD, position_m=np.array([0.5, 1.0, -2.0]))


@dataclass(frozen=True, eq=False)
class Showing(FilmStore):
    """Films of one picture."""

    picture: Picture = BARE

    def pictures(self, film: Film) -> Iterator[Picture]:
        """Yield the picture."""
        yield self.picture


@pytest.mark.parametrize(
    "other",
    [
        {"brightness_01": 0.5},
        {"mark_m": np.array([0.0, 1.5, -2.0])},
        {"moving": ()},
        {"moving": (PlacedProp(block(0.6), AHEAD),)},
        {"moving": (PlacedProp(BARE.moving[0].prop, ASIDE),)},
        {"panels": (replace(BARE.panels[0], text="How?"),)},
        {"panels": (replace(BARE.panels[0], pose=ASIDE),)},
        {"room": replace(ROOM, props=(block(1.1),))},
        {"room": replace(ROOM, props=(replace(ROOM.props[0], emission_01=0.5),))},
        {"room": replace(ROOM, lights=(replace(LAMP, intensity=np.full(3, 0.5)),))},
        {"room": replace(ROOM, sky=np.full(3, 0.3))},
        {"room": replace(ROOM, background_srgb=(9, 9, 9))},
    ],
    ids=lambda other: next(iter(other)),
)
def test_whatever_stands_in_the_picture_changes_the_name(
    other: dict[str, Any], tmp_path: Path
) -> None:
    one, same, changed = (
        Showing({}, tmp_path, tmp_path, picture)
        for picture in (BARE, replace(BARE, room=replace(ROOM)), replace(BARE, **other))
    )
    assert one.name_of(SHORT) == same.name_of(SHORT)
    assert one.name_of(SHORT) != changed.name_of(SHORT)


def test_a_film_built_again_is_equal_to_the_byte(tmp_path: Path) -> None:
    built = []
    for name in ("a", "b"):
        film_files = store(tmp_path / name)
        try:
            film_files.build([SHORT], lambda done, of: None)
        except StageError as problem:
            pytest.skip(str(problem))
        film_path = film_files.file_of(SHORT)
        assert film_path is not None
        built.append(film_path.path.read_bytes())
    assert built[0] == built[1]


@pytest.mark.parametrize(("limit", "times"), [(3, 1), (2, 3)])
def test_a_film_is_posed_once_to_be_named_checked_and_drawn_unless_it_is_long(
    limit: int, times: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    times_ns = []

    def count(frame: SceneFrame) -> Picture:
        times_ns.append(frame.t_ns)
        return picture_of(frame)

    monkeypatch.setattr("visavis.running.film_store.picture_of", count)
    monkeypatch.setattr("visavis.running.film_store.MAX_HELD_POSES", limit)
    film_files = store(tmp_path)
    try:
        film_files.build([SHORT], no_progress)
    except StageError as problem:
        pytest.skip(str(problem))
    assert film_files.file_of(SHORT) is not None
    assert [times] * 3 == [times_ns.count(k * NS_PER_S // 30) for k in range(3)]


def test_a_film_tells_what_drew_it_and_how(tmp_path: Path) -> None:
    film_files = store(tmp_path)
    assert film_files.drawn_by(SHORT) == "unknown"
    try:
        film_files.build([SHORT], lambda done, of: None)
    except StageError as problem:
        pytest.skip(str(problem))
    about = json.loads((tmp_path / f"{film_files.name_of(SHORT)}.json").read_text())
    assert (dict(FILM_QUALITY), dict(ENCODING)) == (about["quality"], about["encoding"])
    assert film_files.drawn_by(SHORT) == about["renderer"] != "unknown"


def test_a_film_of_another_quality_has_another_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = store(tmp_path).name_of(SHORT)
    finer = dict(FILM_QUALITY) | {"shrink_factor": 3}
    monkeypatch.setattr("visavis.running.film_store.FILM_QUALITY", finer)
    assert usual != store(tmp_path / "finer").name_of(SHORT)


def first_picture(film: Film, folder: Path) -> npt.NDArray[np.int64]:
    """Return a film's first picture as it is drawn here."""
    film_files = store(folder)
    try:
        with film_drawing() as draw:
            image = draw(next(film_files.pictures(film)), film_files.cameras(film)[0], film.size_px)
    except StageError as problem:
        pytest.skip(str(problem))
    return image.astype(np.int64)


MIDDLE = replace(SHORT, size_px=(160, 160))


def test_a_graphics_card_draws_films_as_a_processor_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = first_picture(MIDDLE, tmp_path)
    monkeypatch.setattr("visavis.stage.card.context.draws_on_processor", lambda context: False)
    assert np.array_equal(usual, first_picture(MIDDLE, tmp_path))


DRAW_ELSEWHERE = """
import sys
from pathlib import Path
import moderngl, numpy as np
print(moderngl.create_context(standalone=True, backend="egl").info["GL_RENDERER"], flush=True)
from tests.running.page.test_film_store import MIDDLE, first_picture
np.save(sys.argv[1], first_picture(MIDDLE, Path(sys.argv[2])))
"""
SEEN_CODES = 3
"""Two pixels of so many codes apart, of 255, are not told from each other side by side."""


def test_two_graphics_drivers_draw_a_film_that_looks_the_same(tmp_path: Path) -> None:
    """Mesa's two drivers share no code that fills triangles."""
    code = [sys.executable, "-c", DRAW_ELSEWHERE, str(tmp_path / "other.npy"), str(tmp_path)]
    softly = {**os.environ, "GALLIUM_DRIVER": "softpipe"}
    process = subprocess.run(code, capture_output=True, text=True, env=softly, check=False)
    if "softpipe" not in process.stdout:
        pytest.skip(f"there is no second driver here: {process.stderr[-200:]}")
    assert 0 == process.returncode, process.stderr
    apart = np.abs(first_picture(MIDDLE, tmp_path) - np.load(tmp_path / "other.npy")).max(axis=2)
    assert apart.mean() < 0.5
    assert (apart > SEEN_CODES).mean() < 0.001


def test_what_is_drawn_of_a_film_is_what_raters_are_shown(tmp_path: Path) -> None:
    """A film drawn again, as preview does before it is built, and the file that is played."""
    film_files = store(tmp_path)
    try:
        with film_drawing() as draw:
            again = FilmPictures(film_files, MIDDLE.size_px[1], draw).at(MIDDLE, 0.0).astype(int)
        film_files.build([MIDDLE], lambda done, of: None)
    except StageError as problem:
        pytest.skip(str(problem))
    file = film_files.file_of(MIDDLE)
    assert file is not None
    with av.open(str(file.path)) as container:
        played = next(container.decode(video=0)).to_ndarray(format="rgb24").astype(int)
    apart = np.abs(again - played).max(axis=2)
    assert apart.mean() < 4  # what the encoder leaves out
    assert np.abs((again - played).mean(axis=(0, 1))).max() < 2.5  # nor lighter or redder


def test_a_film_damaged_in_the_cache_is_built_anew(tmp_path: Path) -> None:
    film_files = store(tmp_path)
    path = tmp_path / f"{film_files.name_of(SHORT)}.webm"
    path.write_bytes(b"damaged")
    path.with_suffix(".json").write_text('{"sha256": "other"}', encoding="utf-8")
    assert film_files.file_of(SHORT) is None


def test_films_by_different_cameras_are_told_apart_and_whom_they_film_must_be_there(
    tmp_path: Path,
) -> None:
    film_files, near = store(tmp_path), replace(SHORT, lens=Following(back_m=2.0))
    assert film_files.name_of(near) != film_files.name_of(replace(SHORT, lens=Following()))
    assert (
        near.frame_count
        == len(film_files.cameras(near))
        == len(film_files.film_seen(near).is_visible)
    )
    nobody = replace(SHORT, lens=Placed(((0.0, 2.0, 1.0),), subject="walker"))
    with pytest.raises(DesignError, match="nobody who is 'walker'"):
        film_files.name_of(nobody)


@pytest.mark.parametrize("wrong", [{"seconds": 0.0}, {"size_px": (65, 64)}, {"rate_hz": 0}])
def test_films_that_cannot_be_made_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(DesignError):
        replace(SHORT, **wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["stare", "crowd", "waving"])
def test_a_study_of_the_laboratory_is_refused_before_anybody_is_let_in(name: str) -> None:
    with pytest.raises(DesignError, match=f"{name} cannot be performed on a page"):
        film_store(find_study(name).experiment({}))


@pytest.mark.parametrize(
    ("lines", "lacking"),
    [
        ('needs=["eye_tracker"]', "eye_tracker"),
        ('needs=["body_tracker", "responses"]', "body_tracker"),
        ('measures=[*looks_at("word", scene="face")]', "gaze"),
    ],
)
def test_what_no_page_has_is_refused_by_name_with_the_way_out(
    tmp_path: Path, lines: str, lacking: str
) -> None:
    (tmp_path / "seen.py").write_text(SEEN.replace("LINES", lines), "utf-8")
    with pytest.raises(DesignError, match=rf"it needs {lacking}\b.* no page has\. .*on=.lab."):
        require_roles_of_pages(find_study(str(tmp_path / "seen.py")).experiment({}))


def test_sessions_that_began_are_seen_again_and_gone_on_with(tmp_path: Path) -> None:
    def request_of(lines: str) -> Request:
        (tmp_path / "seen.py").write_text(SEEN.replace("LINES", lines), "utf-8")
        study = find_study(str(tmp_path / "seen.py"))
        config = load_config(EXAMPLE).model_copy(update={"data_root": tmp_path / "data"})
        return simulated_request(study, study.experiment({}), config, label="S01", index=0, seed=1)

    def crash(*_: object) -> None:
        raise RuntimeError("the computer stops")

    with pytest.raises(DataError, match="refused a simulated page"):
        perform_new(replace(request_of(""), on_trial=crash))
    (path,) = (tmp_path / "data").rglob("ses-001")
    now = request_of('needs=["eye_tracker"]')
    recording = Recording(perform_rest(now, path))
    assert "complete" == recording.status
    row = {str(name): value for name, value in recording.trials().iloc[0].items()}
    assert isinstance(now.study, OpenedStudy)
    assert seen_trial(now.study, recording, row).steps
    with pytest.raises(DesignError, match="needs eye_tracker"):
        perform_new(replace(now, person=replace(now.person, label="S02")))


def test_a_page_that_refuses_a_study_does_so_at_plan_and_before_a_session(tmp_path: Path) -> None:
    (tmp_path / "seen.py").write_text(SEEN.replace("LINES", 'needs=["eye_tracker"]'), "utf-8")
    (tmp_path / "lab_config.yaml").write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    for verb in (["plan"], ["run", "--devices", "sim", "--fast", "--participant", "1"]):
        config = ["--config", str(tmp_path / "lab_config.yaml")]
        answer = CliRunner().invoke(app, [verb[0], str(tmp_path / "seen.py"), *verb[1:], *config])
        assert isinstance(answer.exception, DesignError), answer.output
        assert "it needs eye_tracker, which no page has" in str(answer.exception)
    assert [] == list(tmp_path.rglob("ses-*"))


def test_a_study_that_no_page_performs_is_neither_served_nor_exported_but_imported(
    tmp_path: Path,
) -> None:
    (tmp_path / "seen.py").write_text(SEEN.replace("LINES", 'needs=["eye_tracker"]'), "utf-8")
    (tmp_path / "lab_config.yaml").write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    (tmp_path / "results.txt").write_text('{"run": "a", "line": 0, "arrived": {}}\n', "utf-8")

    def ask(verb: str, *words: str) -> Any:
        config = ["--config", str(tmp_path / "lab_config.yaml"), "--devices", "sim"]
        return CliRunner().invoke(app, [verb, str(tmp_path / "seen.py"), *words, *config])

    for verb, *words in (["serve"], ["export-web", "--places", "2", "-o", str(tmp_path / "b")]):
        answer = ask(verb, *words)
        assert isinstance(answer.exception, DesignError), answer.output
        assert "it needs eye_tracker, which no page has" in str(answer.exception)
    assert not (tmp_path / "b").exists()
    answer = ask("import-web", str(tmp_path / "results.txt"))
    assert "0 recorded" in answer.output
    assert "left out: run a" in answer.output


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ('"F", "j"', "the key 'F', which no press on a page would be; did you mean 'f'?"),
        ('"answer", ["return"]', "the key 'return', which no press on a page would be; known: "),
    ],
)
def test_a_key_that_no_page_reports_is_refused_before_a_session(
    tmp_path: Path, keys: str, says: str
) -> None:
    text = """from visavis import Factor, Keys, Study, Text
study = Study("pressed", "S", factors=[Factor("a", [1, 2])], on="browser", uses=(), calibrate=False)

@study.trial
def trial(t):
    yield t.show(Text("+"), until=Keys(KEYS), limit_s=1)
"""
    path = tmp_path / "pressed.py"
    path.write_text(text.replace("KEYS", keys), "utf-8")
    with pytest.raises(DesignError, match=re.escape(says)):
        require_roles_of_pages(find_study(str(path)).experiment({}))
    path.write_text(
        text.replace("KEYS", '"answer", ["trigger", "1", "ü", "-", "tab", "escape", "f1"]'), "utf-8"
    )
    require_roles_of_pages(find_study(str(path)).experiment({}))
