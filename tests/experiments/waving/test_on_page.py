"""Waving in a headset's own browser: a study of its own name, simulated, analysed, never pooled."""

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.running.test_every_study import on_kit, recorded
from tests.store import STORE
from visavis.cli.main import app
from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.waving.on_page import film_of, study
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import DataError, DesignError
from visavis.recording.folder import SIMULATED_ROOT
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.film_store import film_store
from visavis.running.live_film import live_film_files
from visavis.running.quick import quick_study
from visavis.stimuli.motion.skeleton import Skeleton, forward
from visavis.study.derive import derive
from visavis.study.experiment import StudyExperiment
from visavis.study.films import Directed, Film, LiveFilm, Voice
from visavis.study.scenes import Scene
from visavis.study.trial import TrialScript

SMALL = {
    "clerk": ["clerk_left"],
    "participant_place": ["place_3"],
    "increment": 0.1,
    "before_s": 0.3,
    "wave_s": 0.6,
    "after_s": 0.1,
    "intertrial_s": 0.1,
    "blocks": 1,
}
SEED = 1
PEOPLE = 2


def visavis(*command: object) -> str:
    result = CliRunner().invoke(app, [str(word) for word in command])
    if result.exception is not None:
        raise result.exception
    return result.output


def simulated(root: Path) -> Path:
    """Return the folder of two simulated people's sessions, recorded once in a run."""

    def simulate(at: Path) -> Path:
        given = [f"--set={name}={value}" for name, value in SMALL.items()]
        few = ["--participants", PEOPLE, "--seed", SEED, "--processes", 1]
        visavis("simulate", study.name, *few, *given, "--output", at, "--config", EXAMPLE)
        return at / SIMULATED_ROOT / study.name

    return STORE.copy("small waving_page", simulate, root)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulated(tmp_path_factory.mktemp("waving_page"))


@pytest.fixture(scope="module")
def recording(folder: Path) -> Recording:
    return Recording(next(folder.glob("*/*/manifest.json")).parent)


def opened() -> OpenedStudy:
    found = find_study(study.name)
    assert isinstance(found, OpenedStudy)
    return found


def test_everybody_stands_in_a_headset_and_answers_by_ray(recording: Recording) -> None:
    rows = recording.trials()
    assert ["complete"] * len(rows) == list(rows["status"])
    assert {"headset"} == {*rows["seen_in"]}
    assert {"ray"} == {*rows["who_by"], *rows["realism_by"]}
    assert {1} == {*rows["live_rounds"]}
    assert ((rows["who"] == rows["target_place"]) == rows["is_right"]).all()
    assert {"head", "frame_timing", "pointer", "responses"} == {*recording.stream_names}


def test_times_to_answers_run_from_when_their_questions_opened(recording: Recording) -> None:
    rows = recording.trials()
    lasts_ms = 1000 * (SMALL["before_s"] + SMALL["wave_s"] + SMALL["after_s"])
    waited = (rows["live_off_ns"] - rows["live_on_ns"]) / 1e6
    # The last answer ends the step: what it took comes after the scene, not from its onset.
    assert pytest.approx(waited - rows["realism_ms"]) == [lasts_ms] * len(rows)
    assert (rows["who_ms"] < rows["realism_ms"]).all()


def test_warped_waves_say_what_was_asked_for_and_reached_and_none_is_corrected(
    recording: Recording,
) -> None:
    rows = recording.trials()
    warped = rows["technique"] == "warping"
    assert {1.1} == {*rows.loc[warped, "coverage_wanted"].round(2)}
    assert rows.loc[~warped, "coverage_wanted"].isna().all()
    names = recording.events()["name"]
    assert (len(rows), 0) == ((names == "wave").sum(), (names == "warp").sum())


def test_the_quick_path_answers_as_a_session_does(folder: Path) -> None:
    experiment = opened().experiment(SMALL)
    quick = quick_study(opened(), experiment, tracker_of, range(PEOPLE), seed=SEED).trials
    for index, path in enumerate(sorted(folder.glob("*/*/manifest.json"))):
        rows = Recording(path.parent).trials()
        rows = rows[~rows["is_practice"].astype(bool)].set_index("trial_id")
        own = quick[quick["participant"] == f"{index:05d}"].set_index("trial_id")
        assert own["who"].to_dict() == rows["who"].to_dict()
        assert own["realism"].to_dict() == rows["realism"].to_dict()


def test_report_tables_and_exports_say_that_it_is_the_variant(folder: Path, tmp_path: Path) -> None:
    visavis("analyse", folder, "--processes", 1)
    report = (folder / "derived" / "report.html").read_text("utf-8")
    assert "In a headset&#x27;s own browser" in report or "In a headset's own browser" in report
    assert "not pooled with those of waving" in " ".join(report.split())
    visavis("export", folder, "--format", "bids", "--output", tmp_path / "bids")
    about = (tmp_path / "bids" / "dataset_description.json").read_text("utf-8")
    assert "waving_page" == json.loads(about)["Name"]


def test_sessions_of_the_variant_and_of_waving_are_not_pooled(folder: Path, tmp_path: Path) -> None:
    both = tmp_path / "both"
    shutil.copytree(folder, both)
    published = recorded(on_kit("waving"), "waving", tmp_path / "lab", 0)
    shutil.copytree(published, both / "sub-S09" / published.name)
    with pytest.raises(DataError, match="sessions of waving, waving_page; analyse one study"):
        visavis("analyse", both, "--processes", 1)


def test_the_published_study_on_a_page_names_its_variant() -> None:
    for xr in ("never", "required"):
        own = derive("waving", "own_waving", on="browser", xr=xr)
        with pytest.raises(DesignError, match="perform waving_page, its variant"):
            film_store(StudyExperiment(own, {}))


def test_the_variant_compares_and_measures_what_the_published_study_does() -> None:
    published = find_study("waving").study
    assert published.analysis.compare == study.analysis.compare
    assert published.analysis.measures == study.analysis.measures
    assert published.design == study.design
    assert published.analysis.primary == study.analysis.primary


def test_a_page_s_files_hold_the_poses_of_every_picture() -> None:
    experiment = opened().experiment(SMALL)
    trial = next(t for t in experiment.plan(0, SEED).trials if t.factors["technique"] == "warping")
    film, store = film_of(TrialScript(trial, experiment.settings)).film, film_store(experiment)
    pictures = list(store.pictures(film))
    files = live_film_files(film, store)
    assert len(pictures[0].cast) == len(files.people) == len(files.poses) == 10
    for k, data in enumerate(files.poses):
        head, arrays = read_arrays(data)
        roots = np.array([p.people.root_m[k] for p in pictures])
        turns = np.array([p.people.orientation_wxyz[k] for p in pictures])
        moves = moves_of(head, arrays)
        again = np.tile(arrays["rest"], (len(pictures), 1, 1)).astype(np.float64)
        again[:, head["moving"]] = moves[:, 3:].reshape(len(pictures), -1, 4)
        # Half a step, and what single precision rounds off in the first picture.
        assert 0 == pytest.approx(np.abs(moves[:, :3] - roots).max(), abs=1.1e-5)
        assert 0 == pytest.approx(np.abs(again - turns * signs(again, turns)).max(), abs=1.1e-5)
        skeleton = pictures[0].cast[k].skeleton
        unit = again / np.linalg.norm(again, axis=-1, keepdims=True)
        apart_m = joints_m(skeleton, moves[:, :3], unit) - joints_m(skeleton, roots, turns)
        assert 0 == pytest.approx(np.linalg.norm(apart_m, axis=-1).max(), abs=1e-4)


def moves_of(head: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    """Undo the coding of a file of poses: a row for every picture, of roots and moving turns."""
    first = np.concatenate([arrays["root_m"], arrays["rest"][head["moving"]].ravel()])
    low_first = arrays["changes"].T.astype(np.int64)
    whole = (low_first << np.array([0, 8, 16, 24])).sum(axis=1).reshape(len(first), -1)
    seconds = np.where(whole % 2, -(whole + 1) // 2, whole // 2)
    steps: np.ndarray = seconds.cumsum(1).cumsum(1)
    moves: np.ndarray = first[:, None].astype(np.float64) + head["step"] * steps
    return moves.T


def joints_m(skeleton: Skeleton, root_m: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Return where joints are in every picture."""
    return forward(skeleton, root_m, turns).position_m


def signs(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.sign((a * b).sum(axis=-1, keepdims=True))


def read_arrays(data: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Read what a page reads, by the description of the format."""
    length = int.from_bytes(data[:4], "little")
    head = json.loads(data[4 : 4 + length])
    at, arrays = -(-(4 + length) // 8) * 8, {}
    for name, shape, kind in head["arrays"]:
        n = int(np.prod(shape))
        arrays[name] = np.frombuffer(data, f"<{kind}", n, at).reshape(shape)
        at += -(-arrays[name].nbytes // 8) * 8
    return head, arrays


@pytest.mark.parametrize(
    ("film", "said"),
    [
        (Scene("person"), "by a camera that stands still"),
        (Film(Scene("person"), 1.0, lens=Directed()), "by a camera that stands still"),
        (Film(Scene("person"), 1.0, voice=Voice("speech.wav")), "silent"),
    ],
)
def test_what_no_page_can_draw_as_a_film_is_refused(film: Any, said: str) -> None:
    with pytest.raises(DesignError, match=said):
        LiveFilm(film)


def test_a_film_that_a_page_draws_is_not_for_devices() -> None:
    with pytest.raises(DesignError, match="a LiveFilm is drawn by pages"):
        opened().experiment(SMALL).check_at_devices()
