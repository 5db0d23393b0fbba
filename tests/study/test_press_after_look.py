"""Simulated people who look for something press once their eyes have come to it."""

import numpy as np
import pandas as pd
import pytest
from PIL import Image as Files

from tests.stimuli.glb_room import write_room
from tests.study.simulated_study import simulate_and_analyse
from visavis import Image, Keys, Room, WhenGazeOn
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Pose
from visavis.people.person import StudyPerson
from visavis.stimuli.gaze_window import GazeWindow, WindowPlace
from visavis.stimuli.own_room import PlacedRoom
from visavis.stimuli.scene import Agent, Scene, SceneFrame
from visavis.stimuli.scenes.audience import PARTICIPANT_EYE_M
from visavis.stimuli.scenes.flat import FlatScene

STEP_NS = 10_000_000
T_NS = np.arange(0, NS_PER_S, STEP_NS)


def looks(*spans_ms):
    """Return whether gaze is on an area at each of `T_NS`, within spans of milliseconds."""
    t_ms = T_NS / 1e6
    return np.any([(begin <= t_ms) & (t_ms < end) for begin, end in spans_ms], axis=0)


def test_a_press_comes_after_the_first_look_that_is_long_enough():
    rule = WhenGazeOn("f", "key", seconds=0.1, other_s=0.3)
    assert 700_000_000 == rule.press_ns(T_NS, looks((100, 180), (300, 900)))
    assert 400_000_000 == rule.press_ns(T_NS, looks((0, 120)))


def test_who_never_looks_long_enough_presses_nothing():
    rule = WhenGazeOn("f", "key", seconds=0.1)
    assert None is rule.press_ns(T_NS, looks((100, 190), (200, 290), (960, 1000)))


@pytest.mark.parametrize("numbers", [{"seconds": 0}, {"seconds": 61}, {"other_s": -0.1}])
def test_numbers_that_cannot_be_are_refused(numbers):
    with pytest.raises(DesignError, match="WhenGazeOn: seconds is"):
        WhenGazeOn("f", "key", **numbers)


def test_an_area_that_is_not_there_is_named_with_the_nearest():
    with pytest.raises(DesignError, match="there is no area or mesh 'kez'; did you mean 'key'"):
        WhenGazeOn("f", "kez").place_among(("cup", "key"))


def searcher(area):
    """Return a person who looks for an area and presses 0.4 s after a look at it."""
    keys = Keys("f", "j", limit_s=30.0)
    person = StudyPerson(
        0,
        1,
        responses={"f or j": keys},
        answer_of=lambda view, response, rng: WhenGazeOn("f", area, other_s=0.4),
    )
    person.prepare(1, 0)
    return person


def see(person, scene, t_ns=0, **more):
    """Let a person see a scene in which nobody's eyes are known."""
    n = len(scene.agents)
    person.see(SceneFrame(scene, t_ns, np.zeros((n, 3)), np.ones(n), **more), t_ns)


@pytest.mark.parametrize("people", [0, 1])
def test_meshes_of_a_room_are_looked_for_by_their_names(tmp_path, people):
    write_room(tmp_path / "office.glb")
    head_m = np.array([-1.5, 1.6, -3.0])
    agent = Agent("a", "c", "", head_m, 0.12, np.array([0.0, 0.0, 1.0]), head_m)
    office = PlacedRoom.of(Room("office.glb"), tmp_path, None)
    scene = Scene("room", (agent,) * people, room=office)
    person = searcher("Red_lamp_001")
    see(person, scene)
    assert person.next_press_ns() is not None
    with pytest.raises(DesignError, match="no area or mesh 'Red_lamp'; did you mean 'Red_lamp_001"):
        see(searcher("Red_lamp"), scene)


def test_a_press_that_is_decided_is_not_put_off_by_what_is_uncovered_later(tmp_path):
    Files.new("RGB", (400, 300)).save(tmp_path / "dark.png")
    areas = "lamp: {ellipse: [360, 90, 40, 40], salience: 5}\nkey: {ellipse: [40, 90, 40, 40]}\n"
    (tmp_path / "dark.yaml").write_text(areas)
    head = Pose(PARTICIPANT_EYE_M, np.array([1.0, 0.0, 0.0, 0.0]))
    image = Image("dark.png", 20, areas="dark.yaml")
    scene = FlatScene(
        "flat",
        (),
        items=(image,),
        folder=tmp_path,
        head=head,
        gaze_window=GazeWindow(3.0),
        answered_by="answer",
    )
    lamp, key = (
        WindowPlace.of(0, PARTICIPANT_EYE_M, [right, 0.052, -0.989]) for right in (0.138, -0.138)
    )
    person = searcher("lamp")
    see(person, scene, window_at=lamp)
    press_ns = person.next_press_ns()
    assert press_ns is not None
    see(person, scene, press_ns - 390_000_000, window_at=key)  # the look was 10 ms ago
    assert press_ns == person.next_press_ns()


STUDY = """
from visavis import Compare, Factor, Image, Keys, Study, WhenGazeOn, looks_at

study = Study("finds", "S",
              factors=[Factor("desk", ["full", "sparse"]), Factor("through", ["all", "window"])],
              repetitions=6, measures=[*looks_at("key", pad_deg=1)],
              compare=[Compare("answer_ms", within=("desk", "through"))])
WINDOW = {"all": {}, "window": {"reveal": "gaze", "window_deg": 5, "blur_deg": 0}}

@study.trial
def trial(t):
    yield t.show(Image("desk.png", 24, areas=f"{t.desk}.yaml"), until=Keys("f", "j"), limit_s=12,
                 background="grey", **WINDOW[t.through])

@study.answer
def answer(seen, response, rng):
    return WhenGazeOn("f", "key", seconds=0.1, other_s=0.4)
"""
AREAS = [f"a{k}: {{rectangle: [{40 * k}, {60 * (k % 4)}, 30, 30]}}" for k in range(9)]
KEY = "key: {rectangle: [350, 250, 30, 30]}"


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """Return the trials of two people who look for a key, before a screen."""
    folder = tmp_path_factory.mktemp("finds")
    Files.new("RGB", (400, 300), (0, 200, 0)).save(folder / "desk.png")
    (folder / "full.yaml").write_text("\n".join([*AREAS, KEY]), "utf-8")
    (folder / "sparse.yaml").write_text("\n".join([AREAS[0], KEY]), "utf-8")
    study = simulate_and_analyse(folder / "finds.py", STUDY, participants=2)
    return pd.read_csv(study / "derived" / "trials.csv")


def test_the_press_comes_after_the_first_look_that_the_tracker_saw(rows):
    presses = rows[rows["answer_ms"].notna()]
    late_ms = presses["answer_ms"] - presses["key_first_look_ms"]
    assert late_ms.notna().mean() > 0.9
    # 0.1 s of looking and 0.4 s of pressing, as well as a tracker and a frame can tell
    assert 500 == pytest.approx(late_ms.median(), abs=30)


def test_whoever_does_not_look_there_long_enough_presses_nothing(rows):
    silent = rows[rows["answer_ms"].isna()]
    assert len(silent) > 5
    assert (silent["key_dwell_ms"] < 150).all()


def test_what_stands_among_more_or_behind_a_window_is_found_later(rows):
    usual_ms = rows["answer_ms"].fillna(12_000).groupby([rows["desk"], rows["through"]]).mean()
    assert usual_ms["sparse", "all"] < usual_ms["full", "all"]
    assert usual_ms["sparse", "all"] < usual_ms["sparse", "window"]
