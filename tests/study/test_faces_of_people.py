"""People of scenes make faces: which, how much, and from when on."""

import re
from dataclasses import replace

import numpy as np
import pytest

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.running.film_store import FilmStore
from visavis.running.live_film import live_film_files
from visavis.running.page.server import SITE
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.characters.character import MORPHS
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.motion.faces import (
    CHANGE_S,
    EXPRESSIONS,
    Face,
    face_of,
    shape_lacking,
)
from visavis.stimuli.picture import PosedPeople
from visavis.study.dry_run import still_view
from visavis.study.films import Film
from visavis.study.scenes import Scene, Staging, stage


def shapes(name, seconds, **options):
    """Return how far each person's shapes of the face go, (people, shapes) by name."""
    staging = Staging(np.random.default_rng(1), 8.0)
    frame = stage(Scene(name, **options), staging, {}).frame(still_view(), 0)
    people = picture_of(replace(frame, t_ns=round(seconds * NS_PER_S))).people
    return {shape: people.morphs_01[:, k] for k, shape in enumerate(MORPHS)}


def of_face(seconds=0.0, **options):
    """Return what a face adds to the shapes of a person who idles."""
    with_face, without = (shapes("person", seconds, **o) for o in (options, {}))
    return {k: float(with_face[k][0] - without[k][0]) for k in MORPHS}


@pytest.mark.parametrize("expression", EXPRESSIONS)
@pytest.mark.parametrize("strength_01", [1.0, 0.5])
def test_a_face_goes_as_far_as_the_study_says_from_the_onset_on(expression, strength_01):
    shape_changes = {k: v for k, v in of_face(face=expression, face_01=strength_01).items() if v}
    expected = {k: strength_01 * v for k, v in EXPRESSIONS[expression].items()}
    assert pytest.approx(expected) == shape_changes


def test_who_has_shapes_of_their_own_for_a_frown_frowns_by_these():
    anna = load_character("anna")
    fine, *others = anna.levels
    frowning = replace(fine, morphs={**fine.morphs, "frown": fine.morphs["smile"]})
    face = Face("frown", 0.5)
    rows = {
        by: face_of(replace(anna, levels=(mesh, *others)), face).weights(0.0)
        for by, mesh in (("smile", fine), ("frown", frowning))
    }
    weights = {
        by: {k: w for k, w in zip(MORPHS, row, strict=True) if w} for by, row in rows.items()
    }
    assert {"smile": {"smile": -0.3}, "frown": {"frown": 0.5}} == weights
    assert {None} == {
        shape_lacking(anna, "frown"),
        shape_lacking(replace(anna, levels=(replace(fine, morphs={"frown": None}),)), "frown"),
    }


def test_checksums_of_recordings_hold_while_nobody_wears_a_later_shape():
    people = PosedPeople(np.zeros((2, 3)), np.zeros((2, 55, 4)), np.zeros((2, len(MORPHS))))
    people.morphs_01[1, MORPHS.index("smile")] = 1.0
    assert (2, 6) == people.parts_moved[2].shape
    people.morphs_01[1, MORPHS.index("frown")] = 0.5
    assert (2, 7) == people.parts_moved[2].shape


def test_pages_draw_as_many_shapes_as_faces_have():
    (count,) = re.findall(r"SHAPES = (\d+)", (SITE / "painting.js").read_text("utf-8"))
    assert len(MORPHS) == int(count)


def test_a_later_face_comes_within_its_time_and_stays():
    smiles = [of_face(t, face="smile", face_from_s=2.0)["smile"] for t in (1.9, 2.25, 2.5, 7.0)]
    assert CHANGE_S == 0.5
    assert pytest.approx([0.0, 0.5, 1.0, 1.0]) == smiles


def test_a_face_goes_as_it_came():
    smiles = [
        of_face(t, face="smile", face_from_s=1.0, face_until_s=3.0)["smile"]
        for t in (1.25, 2.0, 3.0, 3.25, 3.5, 9.0)
    ]
    assert pytest.approx([0.5, 1.0, 1.0, 0.5, 0.0, 0.0]) == smiles


def test_faces_that_are_joined_are_made_at_once():
    face = of_face(0.0, face="smile+open_mouth", face_01=0.5)
    assert {"smile": 0.5, "jaw_open": 0.2} == pytest.approx(
        {name: face[name] for name in ("smile", "jaw_open")}
    )


@pytest.mark.parametrize(("active", "smiles"), [("left", [1.0, 0.0]), ("right", [0.0, 1.0])])
def test_of_two_people_the_active_one_makes_the_face(active, smiles):
    with_face = shapes("two_people", 0.0, active=active, face="smile")
    without = shapes("two_people", 0.0, active=active)
    assert pytest.approx(smiles) == with_face["smile"] - without["smile"]


def test_a_face_moves_nothing_but_its_shapes():
    staging = Staging(np.random.default_rng(1), 8.0)
    scenes = [Scene("person", face="smile"), Scene("person")]
    frames = [stage(scene, staging, {}).frame(still_view(), 0) for scene in scenes]
    smiling, neutral = (picture_of(frame).people for frame in frames)
    assert np.array_equal(neutral.orientation_wxyz, smiling.orientation_wxyz)
    assert np.array_equal(neutral.root_m, smiling.root_m)


def test_who_talks_while_smiling_does_both():
    talking, smiling = (
        shapes("person", 1.3, motion="talk", **o) for o in ({}, {"face": "smile", "face_01": 0.3})
    )
    assert pytest.approx(0.3) == float(smiling["smile"][0] - talking["smile"][0])
    assert np.array_equal(talking["jaw_open"], smiling["jaw_open"])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"face": "smlie"}, "did you mean 'smile'"),
        ({"face": "smile", "face_01": 1.5}, "strength 1.5"),
        ({"face": "smile", "face_from_s": -1.0}, "from -1 s"),
        ({"face": "smile+forwn"}, "no face 'forwn'; did you mean 'frown'"),
        ({"face": "smile", "face_from_s": 2.0, "face_until_s": 2.0}, "from 2 until 2 s"),
        ({"face_until_s": 2.0}, "are of a face; name it"),
        ({"face_01": 0.5}, "are of a face; name it"),
        ({"face_from_s": 2.0}, "are of a face; name it"),
    ],
)
def test_a_face_that_nobody_can_make_is_refused(options, says):
    with pytest.raises(DesignError, match=f"scene person.*{says}"):
        shapes("person", 0.0, **options)


def test_strength_of_a_face_is_a_number():
    with pytest.raises(DesignError, match="a scene's face: face_01 is 'half'; it takes a number"):
        shapes("person", 0.0, face="smile", face_01="half")


def test_a_scene_without_faces_says_so():
    with pytest.raises(DesignError, match="nobody in scene audience makes faces"):
        shapes("audience", 0.0, face="smile")


def test_a_misspelt_face_option_is_named():
    with pytest.raises(DesignError, match="did you mean 'face_01'"):
        shapes("person", 0.0, face="smile", face_1=0.5)


def test_a_scene_that_takes_a_face_of_its_own_is_given_it():
    faces = []

    def by_name(staging, *, face):
        faces.append(face)
        return stage(Scene("person"), staging, {})

    def any_option(staging, **options):
        return by_name(staging, **options)

    for maker in (by_name, any_option):
        stage(Scene("mine", face="grin"), Staging(np.random.default_rng(1), 8.0), {"mine": maker})
    assert ["grin", "grin"] == faces


def test_a_scene_without_an_active_person_makes_no_faces():
    def nobody_is_active(staging):
        person_scene = stage(Scene("person"), staging, {})
        return replace(person_scene, roles={"person": 0})

    with pytest.raises(DesignError, match="nobody in scene mine makes faces"):
        stage(
            Scene("mine", face="smile"),
            Staging(np.random.default_rng(1), 8.0),
            {"mine": nobody_is_active},
        )


def test_a_face_belongs_to_one_side_of_a_pair():
    person = Scene("person")
    with pytest.raises(DesignError, match="a pair takes scenes and no face"):
        stage(
            Scene("pair", left=person, right=person, face="smile"),
            Staging(np.random.default_rng(1), 8.0),
            {},
        )


def test_people_whom_a_page_draws_itself_refuse_faces(tmp_path):
    film = Film(Scene("person", face="smile"), 1.0)
    with pytest.raises(DesignError, match="somebody makes a face"):
        live_film_files(film, FilmStore({}, tmp_path))
