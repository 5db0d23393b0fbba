"""Files of stimuli that are other ones now, or gone, than when a session was recorded."""

import wave
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image as Picture
from typer.testing import CliRunner

from benchmarks.film_in_step import write_film
from tests.cli.viewer_tab import header_of
from tests.faults.sessions import CONFIG
from visavis.cli.main import app
from visavis.cli.viewer.report_views import write_views
from visavis.lab.errors import DesignError
from visavis.recording.manifest import read_manifest
from visavis.results.opened_study import find_study
from visavis.study.sections import TrialToSee

HERE = """
from visavis import Factor, Image, Study, looks_at

study = Study("here", factors=[Factor("side", ["left"])], repetitions=1, calibrate=False,
              measures=[*looks_at("door")])


@study.trial
def trial(t):
    yield t.play("voice.wav", wait="no")
    yield t.show(Image("a.png", 12, areas="a.yaml"), 0.5)
"""
FILM_STUDY = """
from visavis import Factor, Study, Video

study = Study("heard", factors=[Factor("side", ["left"])], repetitions=1, calibrate=False)


@study.trial
def trial(t):
    yield t.show(Video("f.mp4", 9))
"""
PAGE_STUDY = """
from visavis import Factor, Image, Keys, Study, pointer_at

study = Study("paged", factors=[Factor("side", ["left"])], on="browser", uses=(),
              calibrate=False, measures=[*pointer_at("door")])


@study.trial
def trial(t):
    yield t.show(Image("a.png", 12, areas="a.yaml"), until=Keys("f", "j"), limit_s=2,
                 reveal="pointer", window_deg=3)
"""
AREAS = "door: {rectangle: [20, 60, 120, 230]}\nlamp: {ellipse: [300, 100, 80, 60]}\n"
PICTURE_CHANGED = "a.png is another file now than when"
AREAS_GONE = "a.yaml is gone"


def visavis(*arguments: str) -> str:
    result = CliRunner().invoke(app, [*arguments, "--config", str(CONFIG)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert 0 == result.exit_code, result.output
    return " ".join(result.output.split())


def draw(folder: Path, colour: str) -> None:
    Picture.new("RGB", (400, 300), colour).save(folder / "a.png")


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two studies, and sessions of them: the second person of the first study
    saw another picture.
    """
    folder = tmp_path_factory.mktemp("stimuli")
    (folder / "here.py").write_text(HERE, "utf-8")
    (folder / "paged.py").write_text(PAGE_STUDY, "utf-8")
    (folder / "a.yaml").write_text(AREAS, "utf-8")
    with wave.open(str(folder / "voice.wav"), "wb") as voice:
        voice.setparams((1, 2, 48_000, 0, "NONE", ""))
        voice.writeframes(np.full(4800, 1000, "<i2").tobytes())
    for study, people, colour in (("here", 1, "red"), ("here", 2, "blue"), ("paged", 1, "blue")):
        draw(folder, colour)
        simulate = ("simulate", f"{folder / study}.py", "--processes", "1")
        visavis(*simulate, "--participants", str(people), "--output", str(folder / "out"))
    return folder


@pytest.fixture
def folder(root: Path) -> Iterator[Path]:
    """Return that folder, with the files that the last session had."""
    yield root
    (root / "a.yaml").write_text(AREAS, "utf-8")
    draw(root, "blue")


def session_of(folder: Path, study: str, number: int = 0) -> Path:
    return sorted((folder / "out" / "simulated" / study).glob("sub-*/ses-001"))[number]


@pytest.mark.slow
def test_the_voices_that_a_trial_plays_are_among_the_files_that_a_session_keeps(
    folder: Path,
) -> None:
    files = read_manifest(session_of(folder, "here")).configuration["files"]
    assert ["a.png", "a.yaml", "voice.wav"] == [*files]


@pytest.mark.slow
def test_a_frame_that_is_drawn_again_says_which_picture_is_another_one_now(
    folder: Path, tmp_path: Path
) -> None:
    for number, is_other in ((0, True), (1, False)):
        png = tmp_path / f"{number}.png"
        session = session_of(folder, "here", number)
        output = visavis("redraw", str(session), "--frame", "60", "--png", str(png))
        assert is_other == (PICTURE_CHANGED in output)


@pytest.mark.slow
def test_a_page_of_several_sessions_says_whose_picture_is_another_one_now(
    folder: Path, tmp_path: Path
) -> None:
    sessions = [session_of(folder, "here", number) for number in (0, 1)]
    for colour, others in (("red", sessions[1:]), ("blue", sessions[:1]), ("green", sessions)):
        draw(folder, colour)
        view = ("view", str(folder / "out/simulated/here"), "--participants", "all")
        output = visavis(*view, "--trial", "T01", "-o", str(tmp_path / f"{colour}.html"))
        assert f"{PICTURE_CHANGED} {', '.join(map(str, others))} w" in output


@pytest.mark.slow
def test_maps_of_gaze_say_which_picture_under_them_is_another_one_now(
    folder: Path, tmp_path: Path
) -> None:
    study = str(folder / "out/simulated/here")
    draw(folder, "green")
    output = visavis("gaze-map", study, "--by", "side", "-o", str(tmp_path))
    assert PICTURE_CHANGED in output


def tables_with_and_without(file: Path, study: Path, folder: Path, words: str) -> list[Path]:
    """Analyse a study with a file and once it is gone, which `words` then say; return the folders
    of tables.
    """
    for name in ("there", "gone"):
        if name == "gone":
            file.unlink()
        output = visavis("analyse", str(study), "--processes", "1", "--output", str(folder / name))
        assert (name == "gone") == (words in output)
    return [folder / "there", folder / "gone"]


@pytest.mark.slow
@pytest.mark.parametrize("study", ["here", "paged"])
def test_sessions_whose_areas_are_gone_from_beside_the_study_are_measured_by_their_own(
    folder: Path, tmp_path: Path, study: str
) -> None:
    sessions = folder / "out/simulated" / study
    folders = tables_with_and_without(folder / "a.yaml", sessions, tmp_path, AREAS_GONE)
    tables = [pd.read_csv(one / "trials.csv") for one in folders]
    pd.testing.assert_frame_equal(*tables)
    measures = [name for name in tables[0] if name.startswith("door_")]
    assert measures
    assert tables[0][measures].notna().any(axis=None)


@pytest.mark.slow
@pytest.mark.parametrize("study", ["here", "paged"])
def test_sessions_whose_picture_is_gone_are_measured_and_it_is_named(
    folder: Path, tmp_path: Path, study: str
) -> None:
    sessions = folder / "out/simulated" / study
    folders = tables_with_and_without(folder / "a.png", sessions, tmp_path, "a.png is gone")
    tables = [{p.name: p.read_bytes() for p in one.glob("*.csv")} for one in folders]
    assert {"trials.csv", "participants.csv", "cell_means.csv"} == set(tables[0])
    assert tables[0] == tables[1]


@pytest.mark.slow
def test_a_silent_film_that_is_gone_is_no_change_of_the_study(tmp_path: Path) -> None:
    (tmp_path / "silent.py").write_text(FILM_STUDY.replace("heard", "silent"), "utf-8")
    film = write_film(tmp_path / "f.mp4", 30)
    simulate = ("simulate", str(tmp_path / "silent.py"), "--processes", "1", "--participants", "1")
    visavis(*simulate, "--output", str(tmp_path / "out"))
    film.unlink()
    analyse = ("analyse", str(tmp_path / "out/simulated/silent"), "--processes", "1")
    output = visavis(*analyse)
    assert "f.mp4 is gone" in output
    assert "has changed since" not in output


@pytest.mark.slow
def test_sessions_whose_film_was_heard_and_is_gone_keep_when_it_was_heard(tmp_path: Path) -> None:
    (tmp_path / "heard.py").write_text(FILM_STUDY, "utf-8")
    film = write_film(tmp_path / "f.mp4", 30, is_heard=True)
    simulate = ("simulate", str(tmp_path / "heard.py"), "--processes", "1", "--participants", "1")
    visavis(*simulate, "--output", str(tmp_path / "out"))
    sessions = tmp_path / "out/simulated/heard"
    folders = tables_with_and_without(film, sessions, tmp_path, "f.mp4 is gone")
    tables = [(one / "trials.csv").read_bytes() for one in folders]
    assert tables[0] == tables[1]
    assert b"stimulus_sound_on_ns" in tables[0]


@pytest.mark.slow
def test_a_report_has_no_pages_of_sessions_whose_picture_is_gone_and_names_it(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    session = session_of(folder, "here")
    study, trial = session.parent.parent, TrialToSee(session.parent.name[4:], "ses-001", "T01", "")
    (folder / "a.png").unlink()
    write_views(study, tmp_path, [trial])
    output = " ".join(capsys.readouterr().out.split())
    assert f"no page of trials of {session}: there is no picture" in output
    assert "of before" not in output
    assert [] == list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_report_whose_picture_is_gone_says_that_it_opens_a_page_of_before(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    session = session_of(folder, "here")
    study, trial = session.parent.parent, TrialToSee(session.parent.name[4:], "ses-001", "T01", "")
    write_views(study, tmp_path, [trial])
    (page,) = (tmp_path / "views").iterdir()
    before = page.read_bytes()
    (folder / "a.png").unlink()
    write_views(study, tmp_path, [trial])
    assert before == page.read_bytes()
    output = " ".join(capsys.readouterr().out.split())
    assert f"no new page of trials of {session}: there is no picture" in output
    assert f"; the report opens {page.name} of before" in output


@pytest.mark.slow
@pytest.mark.parametrize("study", ["here", "paged"])
def test_a_page_of_a_session_whose_areas_are_gone_has_them_from_the_recording(
    folder: Path, tmp_path: Path, study: str
) -> None:
    (folder / "a.yaml").unlink()
    page = tmp_path / "page.html"
    output = visavis("view", str(session_of(folder, study, -1)), "-o", str(page))
    assert AREAS_GONE in output
    (flat,) = (scene["flat"] for scene in header_of(page)["scenes"] if "flat" in scene)
    assert ["door", "lamp"] == [area["name"] for area in flat["areas"]]


@pytest.mark.parametrize("video", ['Video("f.mp4", 9)', 'Panorama("f.mp4")', 'Image("f.png", 9)'])
def test_what_was_shown_may_be_gone_in_recorded_sessions_alone(tmp_path: Path, video: str) -> None:
    text = HERE.replace('Image("a.png", 12, areas="a.yaml"), 0.5', f"{video}, 0.5")
    file = tmp_path / "here.py"
    text = text.replace("import Factor", "import Factor, Panorama, Video")
    file.write_text(text.replace('*looks_at("door")', ""), "utf-8")
    study = find_study(str(file))
    of_recording = study.experiment({}, is_recorded=True)
    assert of_recording.files_gone is not None
    assert {video.split('"')[1]} == of_recording.files_gone.names
    with pytest.raises(DesignError, match=f"there is no .*{video.split(chr(34))[1]}"):
        study.experiment_to_run({})


def test_a_session_is_not_performed_without_a_file_of_areas(tmp_path: Path) -> None:
    draw(tmp_path, "red")
    (tmp_path / "here.py").write_text(HERE, "utf-8")
    study = find_study(str(tmp_path / "here.py"))
    with pytest.raises(DesignError, match="no file of areas"):
        study.experiment_to_run({})


def test_an_area_that_no_file_has_is_refused_by_name_also_in_recorded_sessions(
    tmp_path: Path,
) -> None:
    draw(tmp_path, "red")
    (tmp_path / "a.yaml").write_text(AREAS, "utf-8")
    (tmp_path / "here.py").write_text(HERE.replace('"door"', '"dor"'), "utf-8")
    study = find_study(str(tmp_path / "here.py"))
    with pytest.raises(DesignError, match="no area or role 'dor'"):
        study.experiment({}, is_recorded=True)


AREAS_AS = {
    "a.yaml": AREAS,
    "a.csv": "area,x,y\ndoor,20,60\ndoor,140,60\ndoor,140,290\nlamp,0,0\nlamp,9,0\nlamp,9,9\n",
    "a.svg": '<svg viewBox="0 0 400 300"><rect id="door" width="9" height="9"/></svg>',
    "a.png": "",
}


@pytest.mark.parametrize("file", AREAS_AS)
def test_an_area_that_no_file_has_is_refused_by_name_also_where_the_picture_is_gone(
    tmp_path: Path, file: str
) -> None:
    if file == "a.png":
        labels = Picture.new("RGB", (400, 300), "black")
        labels.paste((255, 0, 0), (20, 60, 140, 290))
        labels.save(tmp_path / file)
        area = "red"
    else:
        (tmp_path / file).write_text(AREAS_AS[file], "utf-8")
        area = "door"
    study = HERE.replace("a.png", "gone.png").replace("a.yaml", file).replace("door", "NAME")
    for name in (area, "dor"):
        (tmp_path / "here.py").write_text(study.replace("NAME", name), "utf-8")
        opened = find_study(str(tmp_path / "here.py"))
        if name == area:
            assert opened.experiment({}, is_recorded=True).files_gone is not None
        else:
            with pytest.raises(DesignError, match="no area or role 'dor'"):
                opened.experiment({}, is_recorded=True)


BESIDE = """yield t.show([Image("b.png", 5, areas="b.yaml"), Image("gone.png", 9)], 0.5)"""


def test_an_area_beside_a_picture_that_is_gone_is_refused_by_name_where_there_is_none(
    tmp_path: Path,
) -> None:
    Picture.new("RGB", (400, 300), "red").save(tmp_path / "b.png")
    (tmp_path / "b.yaml").write_text(AREAS, "utf-8")
    text = HERE.replace('yield t.show(Image("a.png", 12, areas="a.yaml"), 0.5)', BESIDE)
    for name in ("door", "dor"):
        (tmp_path / "here.py").write_text(text.replace('"door"', f'"{name}"'), "utf-8")
        opened = find_study(str(tmp_path / "here.py"))
        if name == "door":
            opened.experiment({}, is_recorded=True)
        else:
            with pytest.raises(DesignError, match="no area or role 'dor'"):
                opened.experiment({}, is_recorded=True)


def test_names_of_areas_of_a_file_that_is_gone_are_only_in_recordings(tmp_path: Path) -> None:
    draw(tmp_path, "red")
    (tmp_path / "here.py").write_text(HERE.replace('"door"', '"dor"'), "utf-8")
    opened = find_study(str(tmp_path / "here.py"))
    files_gone = opened.experiment({}, is_recorded=True).files_gone
    assert files_gone is not None
    assert files_gone.hides_areas
