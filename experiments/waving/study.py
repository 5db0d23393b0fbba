"""Waving at whom: one of three clerks waves at the participant or at somebody beside them.

The source is A. Jovane, Virtual humans: from motion to interaction (thesis, Université de Rennes,
2023), chapter 2, sections 2.3.1 to 2.3.3. Means per direction are in figures only.
"""

from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import asdict, astuple, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from visavis.experiments.waving.clips import (
    CLERK_NAMES,
    DEFAULT_MAKING,
    DIRECTIONS,
    FINE_PX,
    LOOP,
    PLACES,
    REFINING,
    SCENE_SEED,
    SETTINGS,
    TECHNIQUES,
    UNITS,
    WARPED_PARTS,
    Making,
    StudyWave,
    reached_in,
    solved_key,
    wave_of,
)
from visavis.experiments.waving.facts import FACTS, ORDERS
from visavis.experiments.waving.participant import WavingParticipant
from visavis.experiments.waving.quick_study import quick_trials
from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Pose, Vector
from visavis.protocol.people.simulated_participant import SimulatedParticipant
from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.design import Factor
from visavis.protocol.plan.parameters import Within, known_of
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.shown_scene import RecordedScene
from visavis.protocol.plan.steps import FrameView, NextFrame, Scalar, Show, finite_or_none
from visavis.stimuli.dressing.office import office_eyes, office_scene
from visavis.stimuli.dressing.office_view import VIEW_PX
from visavis.stimuli.motion.warping.track import (
    Reached,
    TrackLoop,
    key_record,
    recorded_track,
    track_record,
)
from visavis.stimuli.picture import Panel
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.office import (
    PARTICIPANT_PLACES,
    STANDING_EYE_M,
    OfficeFrame,
    OfficeScene,
    Waving,
    neighbour,
    shift_m,
)
from visavis.study.comparisons import Compare, published_f
from visavis.study.declaration import Study
from visavis.study.exclusions import STANDARD_RULES, needs_answer
from visavis.study.experiment import StudyExperiment
from visavis.study.measures import column
from visavis.study.pairs import Printed
from visavis.study.responses import Choice, Rating
from visavis.study.scenes import WithEyes, places
from visavis.study.sections import Confusion
from visavis.study.source import Source
from visavis.study.trial import TrialScript

if TYPE_CHECKING:
    from visavis.study.study_functions import TrackerModel

MEAN_ACCURACY: Final = {"orientation": (0.59, 0.25), "warping": (0.67, 0.20)}
"""Mean and SD as printed; over what the SD is taken is not said."""
NO_VALUES: Final = Printed(False, text="not significant (no values)", where="section 2.3.3")
COMPARISON: Final = Compare(
    "is_right",
    within=("technique", "direction"),
    test="art",
    claim="A wave warped to be seen is understood better",
    expects="technique: warping > orientation",
    correction="none",
    options=(("always_posthoc", True), ("correction", "none")),  # as the source's tests
    published={
        "technique": published_f(
            "7.09",
            1,
            15,
            p="0.017",
            eta2p="0.32",
            is_significant=True,
            order="warping > orientation",
            where="section 2.3.3",
        ),
        "direction": published_f(
            "18.92",
            2,
            30,
            p="<0.001",
            eta2p="0.356",
            is_significant=True,
            order="self, left > right",
            where="section 2.3.3",
        ),
        "technique:direction": published_f(
            "2.19", 2, 30, p="0.12", eta2p="0.12", is_significant=False, where="section 2.3.3"
        ),
    },
)
LEVELS: Final = {
    "technique": TECHNIQUES,
    "direction": DIRECTIONS,
    "clerk": CLERK_NAMES,
    "participant_place": PARTICIPANT_PLACES,
}
PRACTICE: Final = {"direction": "self", "participant_place": "place_3"}
REALISM: Final = Rating("realism", 1, 9)
BOARD_SIZE_M: Final = (1.5, 0.5)
BOARD_AT: Final = Pose(np.array([0.0, 1.12, -1.7]), np.array([1.0, 0.0, 0.0, 0.0]))
FOLLOW_STEP_M: Final = 0.01
"""The eyes follow the participant's head in steps of this size."""

_PARTS: Final = " and of ".join(" with ".join(p) for p in WARPED_PARTS).replace("_", " ")

study = Study(
    "waving",
    "Waving at whom?",
    "Is a wave understood better when it is warped to be seen by who is meant?",
    factors=[Factor(name, levels) for name, levels in LEVELS.items()],
    cells=("technique", "direction"),
    derived={
        "target_place": lambda f: neighbour(str(f["participant_place"]), str(f["direction"])).name
    },
    posture="standing",
    xr_variant="waving_page",
    blocks=3,
    practice=[
        PRACTICE | {"technique": "orientation", "clerk": "clerk_middle"},
        PRACTICE | {"technique": "warping", "direction": "left", "clerk": "clerk_left"},
    ],
    parameters={
        **asdict(DEFAULT_MAKING),
        "after_s": 0.6,
        "eye_height_m": STANDING_EYE_M,
    },
    ranges={
        **dict.fromkeys(("before_s", "wave_s", "after_s"), Within(0, open=True)),
        "increment": Within(0, 2),
        "warp_from": ("oriented", "front"),
        "eye_height_m": Within(0.8, 2.2, why="those of people"),
        **LEVELS,
    },
    intertrial_s=1.5,
    texts="texts",
    folder=Path(__file__).parent,
    questionnaires=("demographics", "strategy", "free_comment"),
    validate=False,
    answer_by="ray",
    columns=[
        Column("target_place", "", "the place waved at, place_1 to place_5 from left to right"),
        Column("scene_frames", "1", "display frames that showed the scene before the questions"),
        Column("eye_height_m", "m", "median height of the tracked head above the floor"),
        Column("planned_eye_height_m", "m", "height from which the loop starts for a participant"),
        Column("is_right", "", "the answer is the place waved at"),
        Column(
            "coverage_wanted",
            "1",
            "coverage of head and hand asked for, as a share of the "
            "unwarped wave's; empty where nothing was warped or seen",
        ),
        Column("coverage_reached", "1", "coverage that warping reached, as the same share"),
        Column("target_met_01", "1", "share of the wave's frames in which both targets were met"),
        Column(
            "target_reachable_01",
            "1",
            "share of the wave's poses that can come to both targets, found by search",
        ),
        Column(
            "warp_loop_hz",
            "Hz",
            "corrections a second for the participant's eyes; empty for waves at others",
        ),
        Column("warp_late", "1", "corrections that came too late to be shown"),
        Column("wave_sha256", "", "hash of the wave's poses; its parameters are in event 'wave'"),
    ],
    measures=[
        column("is_right", "", "Accuracy", aggregate="share"),
        column("realism", "1", "Realism (1 to 9)"),
        column("who_ms", "ms", "Time to the answer", aggregate="median"),
    ],
    exclusions=(needs_answer("who"), *STANDARD_RULES),
    compare=[
        COMPARISON,
        replace(
            COMPARISON,
            dv="realism",
            claim="",
            expects="",
            published={
                "technique": NO_VALUES,
                "direction": published_f(
                    "3.97",
                    2,
                    30,
                    p="0.03",
                    eta2p="0.21",
                    is_significant=True,
                    order="self > right",
                    where="section 2.3.3",
                ),
                "technique:direction": NO_VALUES,
            },
        ),
        replace(COMPARISON, dv="who_ms", claim="", expects="", published=None, exploratory=True),
    ],
    # Whether a warped wave is understood (section 2.3): realism and directions are secondary.
    primary=("is_right:technique",),
    sections=[
        Confusion(
            "target_place", "who", by="technique", title="Who was waved at, and who answered"
        ),
        "visavis.experiments.waving.sections:relative_section",
        "visavis.experiments.waving.sections:warping_section",
    ],
    source=Source(
        "A. Jovane, thesis, Université de Rennes, 2023, chapter 2 (visual motion warping), "
        "section 2.3.",
        participants=16,
        cells={"is_right": MEAN_ACCURACY},
        note="Published means per direction are in figures only.",
        where="sections 2.3.1 and 2.3.3",
        facts=FACTS,
        orders=ORDERS,
    ),
    methods=f"""
Participants stood in a line of five customers of an office, in one of the three middle places.
Behind people, plants and furniture that hide more on the right than on the left, a clerk waved at
the participant, at the customer to the left or at the one to the right. The wave began {{before_s}}
s after the scene and lasted {{wave_s}} s; {{after_s}} s later participants said to whom it was
directed, of five places, and how realistic it was from 1 to 9.

With orientation the whole body was turned towards the addressee. With visual warping the wave
(warp_from: {{warp_from}}) was warped to the addressee's view: a share of {{increment}} more
coverage of {_PARTS}, all warping units of {", ".join(UNITS).replace("_", " ")}
allowed to move. Offsets were planned at {SETTINGS.rate_hz:g} Hz for eyes at the addressee's place
(probe {SETTINGS.probe_deg:g}°, damping {SETTINGS.damping:g}, at most {SETTINGS.most_steps} steps a
pose, smoothness {SETTINGS.smoothness:g}), for the participant's own from {{eye_height_m}} m above
the floor on; while the participant was waved at, a control loop corrected them for the tracked head
(one step a key, at most {LOOP.step_cap_deg:g}° for a unit). Plans were searched by a view of
{VIEW_PX} pixels a side, refined, corrected and judged by one of {FINE_PX}.

The eyes were led to the addressee by the same controller with both techniques.

What the source says besides its numbers: participants were less accurate when the wave was to their
right, and rated it less realistic there than when it was to themselves. All named the eyes as a
cue, a quarter of them nothing else.

Where the source says nothing, this platform chose the office's measures (only a sketch is
published), that nine repetitions are the nine combinations of clerk and own place, that coverage is
wanted of the face, not the whole head (a head in profile covers more), and that an answer is
pointed at with a tracked hand, or the head where none is tracked.
""",
    references=(
        "Jovane, A. (2023). Thesis, Université de Rennes, chapter 2 (the study, its published "
        "values and the method of visual motion warping).",
        "Wobbrock, J. O., Findlater, L., Gergle, D., & Higgins, J. J. (2011). The aligned rank "
        "transform for nonparametric factorial analyses. CHI '11, 143–146.",
        "Elkin, L. A., Kay, M., Higgins, J. J., & Wobbrock, J. O. (2021). An aligned rank "
        "transform procedure for multifactor contrast tests. UIST '21, 754–768.",
        "Chaumette, F., & Hutchinson, S. (2006). Visual servo control, part I. IEEE Robotics & "
        "Automation Magazine, 13, 82–90.",
    ),
)


def making_of(parameters: Mapping[str, Any]) -> Making:
    """Return what the waves of a study are made from."""
    return known_of(Making, parameters)


@study.prepare
def prepare(experiment: StudyExperiment) -> list[Callable[[], object]]:
    """Make every wave of the study, which takes seconds each where none is kept yet."""
    making, eye_height_m = making_of(experiment.parameters), experiment.parameters["eye_height_m"]
    waves = {}
    for cell in experiment.conditions():
        is_own = cell["target_place"] == cell["participant_place"]
        key = (cell["clerk"], cell["target_place"], cell["technique"], is_own)
        waves[key] = partial(wave_of, cell, making, eye_height_m)
    return list(waves.values())


def who_question(participant_place: str) -> Choice:
    """Return the question for the addressee: five places from left to right, one's own "me"."""
    own = PLACES.index(participant_place)
    labels = []
    for i in range(len(PLACES)):
        side = "left" if i < own else "right"
        labels.append({0: "me", 1: side}.get(abs(i - own), f"{side}_{abs(i - own)}"))
    return Choice("who", PLACES, labels=labels)


@dataclass
class Office(WithEyes):
    """The office on the display, frame by frame: eyes follow the participant's head in steps."""

    scene: OfficeScene
    observer_m: Vector = field(default_factory=lambda: np.zeros(3))
    step_m: float = FOLLOW_STEP_M
    start_ns: int = 0
    loop: TrackLoop | None = None

    def frame(self, view: FrameView, elapsed_ns: int) -> OfficeFrame:
        """Return what to show from the coming frame on."""
        self.follow(view)
        gaze, openness, _ = self.eyes.at(view.t_ns - self.start_ns, self.observer_m)
        warp = None if self.loop is None else self.loop.track
        distance_m = self.eyes.distance_m(view.t_ns - self.start_ns, self.observer_m)
        return OfficeFrame(
            self.scene,
            view.t_ns,
            gaze,
            openness,
            gaze_distance_m=distance_m,
            start_ns=self.start_ns,
            warp=warp,
        )

    def correct(self, t_ns: int) -> dict[str, Scalar | None] | None:
        """Let the wave be warped for where the participant is; return the key that was taken."""
        if self.loop is None or not self.observer_m.any():
            return None
        eye_m = self.observer_m - shift_m(self.scene.participant_place)
        key = self.loop.step((t_ns - self.start_ns) * 1e-9, eye_m)
        if key is None:
            return None
        eye = dict(zip(("eye_x_m", "eye_y_m", "eye_z_m"), eye_m.tolist(), strict=True))
        return {**key_record(self.loop.track, key), **eye}


@study.trial
def trial(t: TrialScript) -> Generator[Any, Any, None]:
    """Show the wave, then ask to whom it was and how realistic; times count from the onset."""
    wave, plan_columns = None, warp_columns(None)
    if not t.is_read:
        wave = wave_of(t.trial.factors, making_of(t.settings.parameters), t.eye_height_m)
    scene = office_scene(t.participant_place, None if wave is None else wave.waving, SCENE_SEED)
    scene_s = t.before_s + t.wave_s + t.after_s
    longest_s = scene_s + 2 * t.settings.ways.limit_s + 5.0
    eyes = office_eyes(scene, t.target_place, t.trial.seed, longest_s, t.before_s - 0.3)
    view = yield NextFrame()
    office = Office(scene, places(scene), eyes, start_ns=view.t_ns, loop=loop_of(t, wave))
    t.showing(office, view.t_ns)
    yield Show(office.frame(view, 0))
    view = yield NextFrame()
    start_ns, frames = view.t_ns, 0
    heights: list[float] = []
    yield t.mark("scene_on", scene_name=scene.name)
    if wave is not None:
        yield t.mark("wave", **wave_record(wave, t.increment))
        plan_columns = warp_columns(wave.plan_result)
        t.row |= {"wave_sha256": wave.sha256, **plan_columns}
    end_ns = start_ns + round(scene_s * NS_PER_S)

    def picture(view: FrameView) -> SceneFrame:
        nonlocal frames
        frames += 1
        if view.head_valid:
            heights.append(float(view.head.position_m[1]))
        return office.frame(view, view.t_ns - start_ns)

    # a wave that is warped for where the participant is may be marked in any frame
    step = NextFrame(0 if office.loop is not None else end_ns, picture)
    while view.t_ns < end_ns:
        key = office.correct(view.t_ns)
        if key is not None:
            yield t.mark("warp", **key)
        yield Show(picture(view))
        view = yield step
    loop = office.loop
    loop_result = None if loop is None else loop.came_to(partial(reached_in, about_of(t)))
    t.row |= {
        "t_start_ns": start_ns,
        "scene_frames": frames,
        "eye_height_m": round(float(np.median(heights)), 4) if heights else None,
        "planned_eye_height_m": t.eye_height_m,
    }
    for question in (who_question(t.participant_place), REALISM):
        yield t.ask(question, over_scene=True, at=BOARD_AT, size_m=BOARD_SIZE_M)
    if loop is not None and loop_result is not None:
        t.row |= warp_columns(loop_result.result())
        t.row["target_reachable_01"] = plan_columns["target_reachable_01"]
        t.row |= {
            "warp_loop_hz": round(loop.n_taken / t.wave_s, 2),
            "warp_late": loop.late,
        }
    answer = t.row["who"]
    t.row["is_right"] = None if answer is None else answer == t.target_place
    yield t.dark(0.0)


def wave_record(wave: StudyWave, increment: float) -> dict[str, Scalar | None]:
    """Return what the recording keeps of a wave: enough to make it again and to know it again."""
    record: dict[str, Scalar | None] = {
        "clerk": wave.waving.clerk,
        "wave_sha256": wave.sha256,
        "heading_deg": round(wave.waving.heading_deg, 6),
        "wave_start_s": wave.waving.start_s,
        "wave_s": wave.waving.end_s - wave.waving.start_s,
        "is_warped": wave.plan_result is not None,
    }
    if wave.plan_result is not None and wave.waving.warp is not None:
        record |= {
            "features": "; ".join(f"coverage of {'+'.join(p)}" for p in WARPED_PARTS),
            "increment": increment,
            "largest_offset_deg": float(np.degrees(np.abs(wave.waving.warp.omega_rad).max())),
            **track_record(wave.waving.warp),
            **{f"plan_{name}": value for name, value in asdict(SETTINGS).items()},
            **{f"refine_{name}": value for name, value in asdict(REFINING).items()},
            **{f"loop_{name}": value for name, value in asdict(LOOP).items()},
            "plan_view_px": VIEW_PX,
            "fine_view_px": FINE_PX,
        }
    return record


def track_shown(waving: Waving, wave: Mapping[str, Any], keys: list[dict[str, Any]]) -> Waving:
    """Return a wave warped as its record and those of corrected keys say."""
    is_warped = "offsets_rad" in wave
    return replace(waving, warp=recorded_track(wave, keys) if is_warped else None)


def about_of(t: TrialScript) -> tuple[str, str, Making]:
    """Return the key of a trial's wave: clerk, target place and making."""
    return str(t.clerk), str(t.target_place), making_of(t.settings.parameters)


def loop_of(t: TrialScript, wave: StudyWave | None) -> TrackLoop | None:
    """Return the loop that corrects a wave for the participant's eyes; None for waves at others."""
    track = None if wave is None else wave.waving.warp
    if track is None or t.target_place != t.participant_place:
        return None
    return TrackLoop(track, partial(solved_key, about_of(t)), t.beside)


def warp_columns(result: Reached | None) -> dict[str, Scalar | None]:
    """Return the columns of a trial's row about the warp: wanted, reached, on target, reachable."""
    names = ("coverage_wanted", "coverage_reached", "target_met_01", "target_reachable_01")
    if result is None:
        return dict.fromkeys(names)
    return {n: finite_or_none(round(v, 4)) for n, v in zip(names, astuple(result), strict=True)}


@study.person
def person(
    index: int, seed: int, effect: bool, experiment: StudyExperiment
) -> SimulatedParticipant:
    """Return a simulated participant, who knows the two questions by their words."""
    question_names = {text: response.name for text, response in experiment.words.items()}
    return WavingParticipant(index, seed, effect, question_names=question_names)


@study.quick
def quick(experiment: StudyExperiment, person: WavingParticipant, tracker: "TrackerModel") -> Any:
    """Return a function that performs a plan in a moment, once each wave has been rendered."""
    return partial(quick_trials, person, making=making_of(experiment.parameters))


def _office_shown(
    trial: Trial, wave: Mapping[str, Any], experiment: StudyExperiment
) -> tuple[TrialScript, StudyWave, OfficeScene]:
    """Return a trial's script, its wave without a warp, and the office with the recorded one."""
    script = TrialScript(trial, experiment.settings)
    making = replace(making_of(experiment.parameters), increment=0.0)
    plain = wave_of(script.trial.factors, making, script.eye_height_m)
    waving = track_shown(plain.waving, wave, [])
    return script, plain, office_scene(script.participant_place, waving, SCENE_SEED)


@study.views
def views_of(redrawing: RecordedScene, experiment: StudyExperiment) -> Iterator[SceneFrame]:
    """Yield the office without a board, then with each question and each choice pointed at.

    The wave's offsets are those of the recording, whatever this version would plan.
    """
    name, wave_event = str(redrawing.description["scene_name"]), redrawing.latest("wave")
    if wave_event is None or not name.startswith("office_"):
        yield redrawing.view
        return
    script, plain, office = redrawing.once(
        ("office", wave_event[0]),
        lambda: _office_shown(redrawing.trial(), wave_event[1], experiment),
    )
    bare = OfficeFrame(
        office,
        redrawing.t_scene_ns,
        redrawing.gaze_direction,
        redrawing.eye_openness_01,
        gaze_distance_m=redrawing.gaze_distance_m,
        start_ns=redrawing.since_ns,
        warp=track_shown(plain.waving, wave_event[1], redrawing.since("warp")).warp,
    )
    yield bare
    for question in (who_question(script.participant_place), REALISM):
        prompt, labels = script.words_of(question)
        for pointed_at in (None, *range(len(labels))):
            yield replace(bare, panels=(Panel(prompt, labels, BOARD_AT, BOARD_SIZE_M, pointed_at),))
