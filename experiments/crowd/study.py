"""Through the crowd: do people walk otherwise when contact with virtual people can be felt?

After Berton et al. (2020), 10.1109/TVCG.2020.3041341.
"""

from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from visavis.experiments.crowd.columns import TRIALS
from visavis.experiments.crowd.comparisons import (
    MEASURES,
    RULES,
    VOLUME_AS_PUBLISHED,
    PathThresholds,
    comparisons,
)
from visavis.experiments.crowd.conclusions import QUESTIONS, RULE, conclude
from visavis.experiments.crowd.design import (
    ABOUT_OWN_BODY,
    AFTER_BLOCK,
    AT_END,
    CONDITIONS,
    CROWDS,
    DEFAULT_PARAMETERS,
    HAPTICS_GROUP,
    NEEDED_SIDE_M,
    RANGES,
    TRAINING,
    CrowdParameters,
    check_vibration,
    vibrates,
)
from visavis.experiments.crowd.facts import SOURCE
from visavis.experiments.crowd.haptics import BAND_ROLES, MOTORS
from visavis.experiments.crowd.participant.participant import CrowdParticipant
from visavis.experiments.crowd.paths import GroupPaths, paths_by_group
from visavis.experiments.crowd.redrawing import views_of
from visavis.experiments.crowd.reflex import load_contact
from visavis.experiments.crowd.trial import crowd_scene, laid_out, run_trial
from visavis.protocol.plan.design import Factor
from visavis.protocol.plan.experiment import Demands
from visavis.protocol.plan.parameters import known_of
from visavis.protocol.plan.questionnaires import load_questionnaire
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.protocol.plan.shown_scene import RecordedScene
from visavis.protocol.plan.steps import AskReply, Mark, Prompt, Show
from visavis.results.analysis import StudyAnalysis
from visavis.stimuli.contact.body import ARM_JOINTS
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.station_crowd import (
    EMPTY_STATION,
    TRAINING_CONFIGURATION,
    max_people,
    station_frame,
)
from visavis.study.asking import frame
from visavis.study.declaration import Study
from visavis.study.experiment import StudyExperiment
from visavis.study.parts import SETTABLE
from visavis.study.sections import Conclusion
from visavis.study.trial import TrialScript

if TYPE_CHECKING:
    from visavis.study.study_functions import TrackerModel

NOMINAL_TRIAL_S: Final = 65.0
LOOK_DOWN: Final = (
    "Training: does the participant, looking down and lifting their arms, see their own body "
    "where it is? Then space"
)
MURMUR_FROM_M: Final = ((-8.0, 3.0, -8.0), (8.0, 3.0, -8.0))
"""Where loudspeakers of the station hang, beyond the crowd."""
METHODS: Final = f"""
Participants walked through crowds of idle people in a station ({{density_per_m2}} per square
metre), to a board and back, in blocks of fixed order: without haptics, with armbands that answer
contact of hand, forearm and upper arm (pattern {{pattern}}), and without again. A walk ended when
they were back within {{home_within_m}} m of the mark, or after {{limit_s}} s.

Statistics are of each person's mean over the walks of a block; α is that of each measure. {RULE}
Nothing is made up for lost time.
"""
REFERENCES: Final = (
    "Berton, F., Grzeskowiak, F., Bonneau, A., Jovane, A., Aggravi, M., Hoyet, L., Olivier, A.-H., "
    "Pacchierotti, C., & Pettré, J. (2020). Crowd navigation in VR: exploring haptic rendering of "
    "collisions. IEEE TVCG. 10.1109/TVCG.2020.3041341.",
    "Jovane, A. (2023). Thesis, Université de Rennes, chapter 4 and appendix B (the published "
    "values shown here).",
    "Cho, S. H., Park, J. M., & Kwon, O. Y. (2004). Gender differences in three dimensional gait "
    "analysis data from 98 healthy Korean adults. Clinical Biomechanics, 19, 145–152.",
    "Dice, L. R. (1945). Measures of the amount of ecologic association between species. "
    "Ecology, 26, 297–302.",
    "Schuirmann, D. J. (1987). A comparison of the two one-sided tests procedure. Journal of "
    "Pharmacokinetics and Biopharmaceutics, 15, 657–680.",
    "Schrödter, T., & the PedPy developers. PedPy: analysis of pedestrian dynamics (density by "
    "Voronoi cell, individual speed).",
)

study = Study(
    "crowd",
    "Through the crowd",
    "Do people walk otherwise through a virtual crowd when they feel contact with it?",
    factors=[
        Factor("condition", CONDITIONS, practice_only=(TRAINING,)),
        Factor("configuration", CROWDS, practice_only=(TRAINING_CONFIGURATION,)),
        Factor("group", (HAPTICS_GROUP,), between=True),  # a lab may add the control group
    ],
    derived={"vibrates": vibrates},
    posture="standing",
    cells=("condition",),
    columns=TRIALS,
    measures=(*MEASURES, VOLUME_AS_PUBLISHED),
    compare=tuple(comparisons()),
    questions=QUESTIONS,
    primary=tuple(QUESTIONS),  # what people do; the source ranks none of its hypotheses
    exclusions=RULES,
    thresholds=PathThresholds(),
    pieces="visavis.experiments.crowd.measuring:PIECES",
    sections=[
        "visavis.experiments.crowd.sections:paths_section",
        "visavis.experiments.crowd.sections:walks_section",
        "visavis.experiments.crowd.sections:body_section",
        "visavis.experiments.crowd.sections:haptics_section",
        "visavis.experiments.crowd.sections:measured_section",
    ],
    source=SOURCE,
    methods=METHODS,
    references=REFERENCES,
    blocked_by="condition",
    practice=[{"condition": TRAINING, "configuration": TRAINING_CONFIGURATION}],
    parameters={k: v for k, v in asdict(DEFAULT_PARAMETERS).items() if k not in SETTABLE},
    ranges=RANGES,
    check_of=check_vibration,
    intertrial_s=DEFAULT_PARAMETERS.intertrial_s,
    texts="texts",
    after_block=AFTER_BLOCK,
    skip_after_block=lambda parameters: () if parameters["own_body"] else ABOUT_OWN_BODY,
    questionnaires=AT_END,
    needs=("body_tracker", *BAND_ROLES),
    uses=lambda parameters: ("eye_tracker",) if parameters["record_gaze"] else (),
    spares=(*BAND_ROLES, "eye_tracker"),  # walks without are flagged
    people=lambda parameters: max_people(parameters["density_per_m2"]),
    calibrate=False,
    validate=False,
    folder=Path(__file__).parent,
)


@study.demands
def demands(parameters: Mapping[str, Any]) -> Demands:
    """Arms and hips tracked, the pattern within every band's reach, the floor of the crowd."""
    return Demands(
        segments=(*ARM_JOINTS, "hips"),
        vibrations=dict.fromkeys(BAND_ROLES, known_of(CrowdParameters, parameters).vibration),
        motors=MOTORS,
        floor_side_m=NEEDED_SIDE_M,
        own_body=bool(parameters["own_body"]),
    )


@study.prepare
def prepare(experiment: StudyExperiment) -> list[Callable[[], object]]:
    """Lay out every crowd and load the kernels of contact, which takes seconds."""
    params = known_of(CrowdParameters, experiment.parameters)

    def load(number: int) -> None:
        load_contact(laid_out(number, params.density_per_m2), params)

    numbers = (TRAINING_CONFIGURATION, *experiment.levels["configuration"])
    return [partial(load, number) for number in numbers]


@study.trial
def trial(t: TrialScript) -> Generator[Any, Any, Any]:
    """Walk through the crowd to the board and back; contact is answered at once."""
    if t.murmur:
        for side, corner_m in zip(("left", "right"), MURMUR_FROM_M, strict=True):
            sound = Path(t.murmur).absolute()
            yield t.play(sound, at=corner_m, loops=True, wait="no", name=f"murmur_{side}")
    if t.is_read:
        yield t.wait(NOMINAL_TRIAL_S)
        yield Show(station_frame(crowd_scene(t.trial, t.density_per_m2)[1], 0))
        return {}
    if t.is_practice and t.own_body:
        yield from look_down()
    moved_segments = t.session_memory.setdefault("moved", set())
    params = known_of(CrowdParameters, t.settings.parameters)
    return (
        yield from run_trial(t.trial, params, moved_segments, question=t.text("questions.track"))
    )


def look_down() -> Generator[Any, Any, None]:
    """Let the participant look down at their body until the operator goes on, if one is there."""
    if isinstance((yield Prompt(LOOK_DOWN)), AskReply):
        return
    view = yield from frame()
    while not view.went_on:
        view = yield from frame()
    yield Prompt("")
    yield Mark("own_body_seen")


@study.intertrial
def empty_station(t: TrialScript) -> Iterator[Any]:
    """Stand on the mark in the empty station."""
    yield Show(station_frame(EMPTY_STATION, t.now_ns))
    yield t.wait(t.intertrial_s)


@study.person
def person(index: int, seed: int, effect: bool, experiment: StudyExperiment) -> CrowdParticipant:
    """Return a simulated participant, fitted to the published speed."""
    return CrowdParticipant(index, seed, effect)


@study.quick
def quick(experiment: StudyExperiment, person: CrowdParticipant, tracker: "TrackerModel") -> Any:
    """Return what walks a plan in memory, without display, wires or files."""
    from visavis.experiments.crowd.quick_study import quick_trials  # late: compiles when imported

    questionnaires = [load_questionnaire(name) for name in AFTER_BLOCK]
    return partial(
        quick_trials, person, questionnaires, known_of(CrowdParameters, experiment.parameters)
    )


@study.further
def further(analysis: StudyAnalysis) -> tuple[GroupPaths, ...]:
    """Compare the paths of every group."""
    return paths_by_group(analysis)


@study.conclude
def conclusions(analysis: StudyAnalysis) -> tuple[Conclusion, ...]:
    """Answer the hypotheses of the source."""
    return conclude(analysis)


@study.views
def views(shown: RecordedScene, experiment: StudyExperiment) -> Iterator[SceneFrame]:
    """Yield the views that a frame may have shown, the likeliest first."""
    yield from views_of(shown)


def plan_session(participant_index: int, seed: int, **parameters: Any) -> SessionPlan:
    """Plan a participant's session: one training walk, then the three blocks."""
    return StudyExperiment(study, parameters).plan(participant_index, seed)
