"""Stare in the crowd: do people look more at somebody in an audience who looks at them?

After Raimbaud et al. (2022) and Jovane (2023).
"""

from collections.abc import Generator, Iterator, Mapping
from dataclasses import asdict
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from visavis.experiments.stare import published
from visavis.experiments.stare.comparisons import FAMILIES, MEASURES, RULES, SECOND_VIEW_MEASURES
from visavis.experiments.stare.conclusions import RULE, conclude
from visavis.experiments.stare.design import (
    AVERTED,
    DEFAULT_PARAMETERS,
    LEVELS,
    RANGES,
    StareParameters,
    place_of,
)
from visavis.experiments.stare.facts import FACTS, ORDERS
from visavis.experiments.stare.scene import dark_scene_of, distances
from visavis.experiments.stare.trial import run_trial
from visavis.lab.errors import DesignError
from visavis.people.observer import Observer
from visavis.people.observer.temperament import DEFAULT_POPULATION, scaled_population
from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.design import Factor
from visavis.protocol.plan.parameters import known_of
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.protocol.plan.steps import Show
from visavis.results.analysis import StudyAnalysis
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.audience import DRESSED_BY, SPEAKER_EYE_M
from visavis.study.declaration import Study
from visavis.study.experiment import StudyExperiment
from visavis.study.look_measures import LooksOn
from visavis.study.parts import SETTABLE
from visavis.study.sections import Conclusion
from visavis.study.source import Source
from visavis.study.trial import TrialScript

if TYPE_CHECKING:
    from visavis.study.study_functions import TrackerModel

QUESTIONNAIRES: Final = ("demographics", "social_anxiety", "free_comment")
METHODS: Final = f"""
Participants faced {{agents}} seated agents while one of nine of them was the active agent. Its gaze
was averted (A), directed at the participant (D), averted until first looked at and then directed
(AD), or directed until first looked at and then averted (DA) (after Raimbaud et al., 2022). The
first look that lasted at least {{look_trigger_ms}} ms changed it (0: the first sample of gaze on
the head, padded by {{pad_deg}}°); where nobody looked, the change came at {{switch_at_01}} of the
trial's {{trial_s}} s. The training lasted {{practice_s}} s or longer.

The source names no limits of exclusion; those below are this platform's, set before analysis. As in
the source, each participant's trials of a condition were averaged, alpha is shared by a family of
tests, and social anxiety was correlated without correction.

{RULE}
"""
REFERENCES: Final = (
    "Raimbaud, P., Jovane, A., Zibrek, K., Pacchierotti, C., Christie, M., Hoyet, L., Pettré, J., "
    "& Olivier, A.-H. (2022). The stare-in-the-crowd effect in virtual reality. IEEE Conference "
    "on Virtual Reality and 3D User Interfaces.",
    "Jovane, A. (2023). Thesis, Université de Rennes, chapter 3 and appendix A (the published "
    "values shown here).",
    "Dunn, M. J., et al. (2024). Minimal reporting guideline for research involving eye tracking "
    "(2023 edition). Behavior Research Methods, 56, 4351–4357.",
    "Olsen, A. (2012). The Tobii I-VT fixation filter. Tobii Technology.",
    "Liebowitz, M. R. (1987). Social phobia. Modern Problems of Pharmacopsychiatry, 22, 141–173.",
    "Steiger, J. H. (2004). Beyond the F test. Psychological Methods, 9, 164–182.",
)

study = Study(
    "stare",
    "Stare in the crowd",
    "Do people look more at an agent in a virtual crowd who looks at them?",
    factors=[Factor(name, levels) for name, levels in LEVELS.items()],
    derived={"place": place_of},
    posture="seated",
    repetitions=2,
    blocks=3,
    order="balanced_blocks",
    practice=[{"condition": AVERTED, "zone": "centre", "depth": "middle"}],
    parameters={k: v for k, v in asdict(DEFAULT_PARAMETERS).items() if k not in SETTABLE},
    ranges=RANGES,
    intertrial_s=DEFAULT_PARAMETERS.intertrial_s,
    cells=("condition",),
    measures=[*MEASURES, *SECOND_VIEW_MEASURES],
    families=FAMILIES,
    questions={
        "stare-effect": "A – D, dwell time and fixation count both greater",
        "caught-staring": "A – AD, dwell time and fixation count both greater",
        "catching-staring": "A – DA, dwell time and fixation count both greater",
    },
    # The source's first hypothesis in its static and two dynamic forms (section 3.1).
    primary=("stare-effect", "caught-staring", "catching-staring"),
    exclusions=RULES,
    sections=[
        "visavis.experiments.stare.sections:places_figure",
        "visavis.experiments.stare.sections:changes_section",
    ],
    source=Source(
        published.CITATION,
        published.PARTICIPANTS,
        published.CELLS,
        where="tables 3.1, 3.2, A.1 to A.3",
        facts=FACTS,
        orders=ORDERS,
    ),
    methods=METHODS,
    references=REFERENCES,
    setup={"distances": distances(), "viewing": "seated, head free"},
    looks=[LooksOn("active_index", "t_start_ns", "t_end_ns", "switch_ns")],
    columns=[
        Column("active_index", "", "index of the active agent in the recorded columns"),
        Column("active_agent", "", "its identifier in the event 'scene'"),
        Column("active_character", "", "the character model that played it"),
        Column("switch_ns", "ns", "session time of the frame that showed the gaze change (AD, DA)"),
        Column("switch_ms", "ms", "the same from the trial's start"),
        Column("switch_cause", "", "look: the participant looked at the agent; time: time was up"),
        Column("look_ns", "ns", "session time of the gaze sample that caused the change"),
        Column("scene_frames", "1", "display frames that showed the scene"),
        Column("scene_samples", "1", "gaze samples evaluated online meanwhile"),
    ],
    texts="texts",
    questionnaires=QUESTIONNAIRES,
    needs=["eye_tracker"],
    uses=[],
    calibrate_blocks=True,
    dressed_by=DRESSED_BY,
    folder=Path(__file__).parent,
)


@study.conclude
def conclusions(analysis: StudyAnalysis) -> tuple[Conclusion, ...]:
    """Answer the hypotheses of the source."""
    return conclude(analysis.pairs_of("conditions"), analysis.correlations_of("anxiety"))


@study.check
def check(parameters: Mapping[str, Any]) -> None:
    """Refuse a training that would have to end before it may."""
    shortest_s, longest_s = parameters["practice_s"], parameters["practice_limit_s"]
    if shortest_s > longest_s:
        raise DesignError(
            f"stare: practice_s {shortest_s:g} is the shortest training and practice_limit_s "
            f"{longest_s:g} the longest; give a practice_limit_s that is not shorter"
        )


@study.trial
def trial(t: TrialScript) -> Generator[Any, Any, Any]:
    """Show the audience; the active agent's gaze may change with a look at it."""
    if t.voice:
        x, y, z = SPEAKER_EYE_M.tolist()
        yield t.play(Path(t.voice).absolute(), at=(x, y, z), loops=True, wait="no", name="voice")
    return (yield from run_trial(t.trial, known_of(StareParameters, t.settings.parameters)))


@study.intertrial
def dark(t: TrialScript) -> Iterator[Any]:
    """Stay dark, with the mark at top centre."""
    scene = dark_scene_of(t.trial, t.agents)
    facing = np.array([a.facing for a in scene.agents])
    yield Show(SceneFrame(scene, t.now_ns, facing, np.ones(len(scene.agents))))
    yield t.wait(t.intertrial_s)


@study.scaled
def person_with_effect(
    index: int, seed: int, effect: float, experiment: StudyExperiment
) -> Observer:
    """Return a simulated participant, fitted to the published means and spreads.

    Gaze contact does `effect` times to them what was fitted.
    """
    population = scaled_population(DEFAULT_POPULATION, effect)
    return Observer(index, seed, effect > 0, population=population)


@study.quick
def quick(experiment: StudyExperiment, person: Observer, tracker: "TrackerModel") -> Any:
    """Return what performs a plan in a hundredth of a session's time."""
    from visavis.experiments.stare.quick_study import quick_trials  # late: compiles when imported

    params = known_of(StareParameters, experiment.parameters)
    return partial(quick_trials, person, tracker, params=params)


@lru_cache(maxsize=8)
def experiment_of(params: StareParameters = DEFAULT_PARAMETERS) -> StudyExperiment:
    """Return the experiment as commands make it, with typed parameters."""
    return StudyExperiment(study, asdict(params))


def plan_session(
    participant_index: int, seed: int, *, params: StareParameters = DEFAULT_PARAMETERS
) -> SessionPlan:
    """Plan a participant's session: training, then the blocks; pure."""
    return experiment_of(params).plan(participant_index, seed)
