"""Scenes of people in which somebody's eyes cannot turn: where they may stand, what is recorded."""

from pathlib import Path

import numpy as np
import pytest

from tests.stimuli.glb_figure import write_glb
from visavis.cli.film.stand_in import RESTING_JOINTS, resting_joints, somebody_else
from visavis.devices.registry import OPTION_MODELS
from visavis.lab.config import parse_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import DesignError
from visavis.recording.reader import Recording
from visavis.running.sessions.simulation import SimulationTask, simulate_one
from visavis.stimuli.characters.library import import_characters
from visavis.stimuli.dressing.casting import members_of, use_cast
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.study.dry_run import still_view
from visavis.study.scenes import Scene, Staging, stage

STUDY = """from visavis import Choice, Factor, Scene, Study
study = Study("beside", factors=[Factor("companion", ["mascot"])], texts="texts", calibrate=False)

@study.trial
def trial(t):
    scene = Scene("two_people", active="left", left="anna", right=t.companion)
    yield t.show(scene, seconds=0.5)
    yield t.ask(Choice("looks", ["both", "one"]))

@study.answer
def answer(seen, response, rng):
    has_gaze = seen.looked_at_me_01 == seen.looked_at_me_01
    return "one" if has_gaze.tolist() == [True, False] else "both"
"""


pytestmark = pytest.mark.usefixtures("nobody_cast")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of imported figures, one of them without gaze: "mascot"."""
    folder = tmp_path_factory.mktemp("lab")
    write_glb(folder / "mascot.glb", eye_ahead_m=0.05)
    imports = import_characters(folder / "mascot.glb", folder / "data" / "characters", gaze=False)
    assert all(result.character for result in imports)
    return folder / "data" / "characters"


@pytest.fixture
def lab(nobody_cast: None, library: Path) -> None:
    use_cast(members_of(["anna", "gabriel", "mascot"], library, library), library)


def frame_of(name, **options):
    staging = Staging(np.random.default_rng(1), 8.0)
    return stage(Scene(name, **options), staging, {}).frame(still_view(), 0)


SCENES = {
    "person": ("person", {"character": "mascot", "eyes": "none"}, [False]),
    "companion": ("two_people", {"left": "mascot", "active": "right"}, [False, True]),
    "both": ("two_people", {"left": "mascot", "right": "mascot", "eyes": "none"}, [False, False]),
    "pair": (
        "pair",
        {
            "left": Scene("person", character="mascot", eyes="none"),
            "right": Scene("person", character="gabriel"),
        },
        [False, True],
    ),
}


@pytest.mark.usefixtures("lab")
@pytest.mark.parametrize(("name", "options", "has_gaze"), SCENES.values(), ids=SCENES)
def test_who_has_no_gaze_stands_by_and_is_drawn(name, options, has_gaze):
    frame = frame_of(name, **options)
    has_none = [not each for each in has_gaze]
    assert has_none == np.isnan(frame.gaze_direction).all(axis=1).tolist()
    assert has_none == np.isnan(frame.eye_openness_01).tolist()
    assert has_none == np.isnan(frame.gaze_distance_m).tolist()
    people = picture_of(frame).people
    for poses in (people.root_m, people.orientation_wxyz, people.morphs_01):
        assert np.isfinite(poses).all()


@pytest.mark.usefixtures("lab")
@pytest.mark.parametrize(
    ("name", "options", "says"),
    [
        ("person", {"character": "mascot"}, 'mascot was .* cannot be averted; write eyes="none"'),
        ("person", {"character": "mascot", "eyes": "directed"}, "mascot .* cannot be directed"),
        ("two_people", {"left": "mascot"}, "scene two_people: mascot was imported without gaze"),
        ("person", {"character": "anna", "eyes": "none"}, "anna has gaze; write directed or aver"),
        (
            "person",
            {"character": "mascot", "eyes": "none", "face": "frown"},
            "mascot cannot make the face frown: .* mouthSmileLeft",
        ),
        ("audience", {"eyes": "none"}, "eyes is 'none'"),
    ],
)
def test_a_scene_refuses_who_cannot_do_what_it_asks(name, options, says):
    with pytest.raises(DesignError, match=says):
        frame_of(name, **options)


def test_somebody_stands_in_for_the_participant_whoever_is_cast(library):
    use_cast(members_of(["anna", "mascot"], library, library), library)
    picture = picture_of(frame_of("person", character="mascot", eyes="none"))
    assert "male" == somebody_else(picture).gender
    assert resting_joints(1.2).keys() == set(RESTING_JOINTS)


def test_a_session_does_not_say_where_somebody_without_gaze_looks(library, tmp_path):
    (tmp_path / "texts").mkdir()
    (tmp_path / "texts" / "en.yaml").write_text("instruction: Look.\n", "utf-8")
    (tmp_path / "beside.py").write_text(STUDY, "utf-8")
    folder = library.parent.parent
    text = EXAMPLE.read_text("utf-8") + "cast: [anna, mascot]\n"
    lab = parse_config(text, EXAMPLE, OPTION_MODELS, folder=folder)
    file = str(tmp_path / "beside.py")
    session = Recording(simulate_one(SimulationTask(file, lab, "S01", 0, "", 1, True, {})))
    states = session.stream_arrays("scene_states")
    is_lit = states["gaze_direction"].shape[1] and np.isfinite(states["gaze_direction"][:, 0, 0])
    assert is_lit.any()
    for name in ("gaze_direction", "eye_openness_01", "gaze_distance_m"):
        assert np.isnan(states[name][is_lit, 1]).all()
    assert ["one"] == [row["looks"] for row in session.trials().to_dict("records")]
