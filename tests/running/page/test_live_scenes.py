"""Live figures watched beside a list of questions: on a page, before a screen, elsewhere."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.running.page.pages import config
from tests.running.page.test_elsewhere import Host
from tests.study.test_moulding_before_a_screen import lab
from visavis.cli.recorded_trial import recorded_trial
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.errors import DesignError
from visavis.recording.cached import CachedRecording
from visavis.recording.reader import Recording
from visavis.results.moves import MOVE_COLUMNS, moves_of
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.results.tables.dictionary import trial_columns
from visavis.running.page.replies import check_reply
from visavis.running.page.seen_trial import seen_trial
from visavis.running.page.steps import PageError, PageStep, check_moves
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.study.films import Viewing
from visavis.study.live import LIVE_COLUMNS, Live, LiveScene, walks

STUDY = """
from visavis import Compare, Factor, Live, LiveScene, Rating, Study, walks

study = Study(
    "apart",
    factors=[Factor("style", ["march", "slouch"])],
    compare=[Compare("lively", within="style")],
    calibrate=False,
)
LIVE = Live(walks("set_a", "plain", "march", "slouch"), beside="female_07")


@study.trial
def trial(t):
    scene = LiveScene(LIVE, {t.style: 1.0}, beside={"plain": 1.0})
    yield t.watch(scene, Rating("lively", 1, 5), Rating("heavy", 1, 5), min_rounds=2)


@study.answer
def answer(seen, response, rng):
    if seen.figures is None:
        return 3
    motion, beside = seen.figures.motions
    return 5 if motion.cycle_s < beside.cycle_s else 1
"""
WITH_FILMS = STUDY.replace(
    'scene = LiveScene(LIVE, {t.style: 1.0}, beside={"plain": 1.0})',
    'scene = Film(Scene("person", motion="walk"), 1.0)',
).replace("LiveScene,", "LiveScene, Film, Scene,")
CYCLES_S = {"march": 1.1333, "slouch": 1.2}
"""The longer of the two cycles, that of the plain walk or of the style."""


def study_in(root: Path, text: str = STUDY) -> OpenedStudy:
    """Return a study whose file is in a folder."""
    root.mkdir(exist_ok=True)
    file = root / "apart.py"
    file.write_text(text, "utf-8")
    study = find_study(str(file))
    assert isinstance(study, OpenedStudy)
    return study


def perform(root: Path, where: str, text: str = STUDY) -> tuple[OpenedStudy, Recording]:
    """Return the simulated session of a participant on a page, at a monitor or in a headset."""
    study = study_in(root, text)
    on_page = where == "page"
    made = simulated_request(
        study,
        study.experiment({}),
        config(root) if on_page else lab(where, root / "data"),
        label="S01",
        index=0,
        seed=1,
        effect=True,
    )
    request = replace(made, on="browser" if on_page else "lab", clock=SimClock())
    return study, Recording(perform_new(request))


@pytest.mark.parametrize("where", ["page", "monitor", "headset"])
def test_figures_are_watched_for_their_rounds_and_then_described(
    where: str, tmp_path: Path
) -> None:
    study, recording = perform(tmp_path / where, where)
    rows = recording.trials().set_index("style")
    assert list(rows["status"]) == ["complete"] * 2
    assert dict(rows["lively"]) == {"march": 5, "slouch": 1}
    assert dict(rows["heavy"]) == {"march": 5, "slouch": 1}
    for style, row in rows.iterrows():
        seen_s = (row["live_off_ns"] - row["live_on_ns"]) / NS_PER_S
        assert seen_s > 2 * CYCLES_S[str(style)]
        assert seen_s < 30 or where == "page"  # before a screen its button was pressed
        assert row["live_rounds"] == int(seen_s / CYCLES_S[str(style)])
        assert row["live_frames"] > 60
    columns = trial_columns(study.experiment({}), ())
    assert {f"live_{c.name}" for c in LIVE_COLUMNS} <= set(columns) & set(rows.columns)


def scene(**weights: float) -> LiveScene:
    live = Live(walks("set_a", "plain", "march", "slouch"), beside="female_07")
    return LiveScene(live, weights, beside={"plain": 1.0})


def test_a_scene_moves_as_blends_of_its_examples() -> None:
    figure, beside = scene(march=3.0, slouch=1.0).motions
    assert figure.weights.tolist() == [0.0, 0.75, 0.25]
    assert beside.weights.tolist() == [1.0, 0.0, 0.0]
    assert figure.in_place
    assert scene(slouch=1.0).cycle_s == pytest.approx(CYCLES_S["slouch"])


@pytest.mark.parametrize(
    ("wrong", "refusal"),
    [
        (lambda: scene(hop=1.0), "the figure's blend names hop; examples are plain, march"),
        (lambda: scene(march=0.0), "weights of at least 0, one of them above"),
        (lambda: scene(march=float("nan")), "weights of at least 0"),
        (lambda: LiveScene(scene(march=1).live, {"march": 1.0}), "two figures need both"),
        (
            lambda: LiveScene(replace(scene(march=1).live, beside=""), {"march": 1}, {"plain": 1}),
            "two figures need both",
        ),
        (lambda: Viewing(scene(march=1.0), (), replay=False), "replay=False is for films"),
    ],
)
def test_a_scene_that_cannot_be_is_refused(wrong: Callable[[], object], refusal: str) -> None:
    with pytest.raises(DesignError, match=refusal):
        wrong()


def test_a_page_cannot_forge_what_it_drew_or_when_rounds_began() -> None:
    step = PageStep("watch", {"films": [], "live": {"figure": 0}, "questions": []})
    drawn = {"first_ms": 1.0, "off_ms": 2.0, "ended_by": "button", "frames": 1, "dropped": 0}
    reply = {"shown_ms": 0.0, "answers": {}, **drawn, "slider_frames": 0, "renderer": "x"}
    check_reply(step, {**reply, "rounds": 2})
    for wrong in ({"rounds": -1}, {"frames": 0.5}, {"renderer": 7}, {"off_ms": "x"}):
        with pytest.raises(PageError):
            check_reply(step, {**reply, **wrong})
    moves = {"names": [], "sliders": [], "camera": [], "rounds": [[1.0, 0], [1.5, 1]]}
    check_moves(moves)
    for rows in ([[1.0, 2]], [[1.0]], [["x", 0]], "x"):
        with pytest.raises(PageError):
            check_moves({**moves, "rounds": rows})


def test_a_session_of_a_version_with_films_is_seen_again_with_its_answers(tmp_path: Path) -> None:
    _, recording = perform(tmp_path / "films", "page", WITH_FILMS)
    row = recording.trials().iloc[0].to_dict()
    assert row["film_frames"] > 0
    (step,) = seen_trial(study_in(tmp_path / "live"), recording, row).steps
    assert {q.name: q.answer for q in step.questions} == {"lively": "3", "heavy": "3"}


def test_figures_are_seen_again_as_they_stood(tmp_path: Path) -> None:
    study, recording = perform(tmp_path / "monitor", "monitor")
    row = recording.trials().iloc[0]
    frame_ns = NS_PER_S // 60
    trial = recorded_trial(CachedRecording(recording.path), row["trial_id"])
    (again,) = study.views_of(trial.shown_at(int(row["live_off_ns"]) - frame_ns))
    assert again.people is not None
    names = tuple(person.name for person in picture_of(again).cast)
    assert names == tuple(default_casting(n).name for n in ("female_01", "female_07"))


def test_rounds_stand_in_the_table_of_movements(tmp_path: Path) -> None:
    _, recording = perform(tmp_path / "page", "page")
    rounds = {"names": [], "sliders": [], "camera": [[20.0, 1.0, 1.3, -3.6]]}
    payload = {"tab": "t", "kind": "moved", "step": 3, **rounds, "rounds": [[30.0, 0], [40.0, 1]]}
    events = [
        {"name": "trial_start", "t_ns": 0, "payload": {"trial_id": "T01"}},
        {"name": "page_event", "t_ns": 10**9, "payload": {**payload, "at_ms": 50.0}},
    ]

    class Journal:
        def __init__(self) -> None:
            self.events = events

    class Told(Recording):
        def journal(self, number: int) -> Journal:  # type: ignore[override]
            return Journal()

    moves = moves_of(Told(recording.path))
    assert list(moves.columns) == [c.name for c in MOVE_COLUMNS]
    assert list(moves["what"]) == ["camera", "round", "round_beside"]
    assert np.diff(moves["t_ns"]).tolist() == [10**7, 10**7]


def test_a_study_with_figures_can_be_written_down_for_another_host(tmp_path: Path) -> None:
    bundle = Host(tmp_path, STUDY).export(places=1)
    steps = json.loads((bundle / "places" / "0.json").read_text("utf-8"))["steps"]
    (preload,) = (step for step in steps if step["kind"] == "preload")
    assert {a["name"]: a["bytes"] for a in preload["assets"]} == {
        file.name: file.stat().st_size for file in (bundle / "assets").iterdir()
    }
    assert len(preload["assets"]) == 3  # two people and the walks
    assert {"live.js", "blend.js", "glb.js", "painting.js"} <= {f.name for f in bundle.iterdir()}
    watched = [step for step in steps if step["kind"] == "watch"]
    assert [step["motions"][1] for step in watched] == [[1.0, 0.0, 0.0]] * 2
