"""Through the crowd: do people walk otherwise when contact with virtual people can be felt?

After Berton et al. (2020), 10.1109/TVCG.2020.3041341.
"""

from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, Final

from experiments.crowd.columns import TRIALS
from experiments.crowd.design import (
    AFTER_BLOCK,
    AT_END,
    CONDITIONS,
    CROWDS,
    DEFAULT_PARAMETERS,
    GROUPS,
    HAPTICS_GROUP,
    NEEDED_SIDE_M,
    TRAINING,
    CrowdParameters,
    check_levels,
    vibrates,
)
from experiments.crowd.haptics import BAND_ROLES, MOTORS
from experiments.crowd.participant.participant import CrowdParticipant
from experiments.crowd.redrawing import views_of
from experiments.crowd.reflex import load_contact
from experiments.crowd.trial import intertrial, laid_out, run_trial, standing
from protocol.design import Factor
from protocol.experiment import Demands
from protocol.plan import SessionPlan
from protocol.shown import Shown
from protocol.steps import Plan, Show
from stimuli.contact.body import ARM_JOINTS
from stimuli.scene import SceneFrame
from stimuli.scenes.station_crowd import TRAINING_CONFIGURATION, max_people
from visavis.experiment import StudyExperiment
from visavis.study import SETTABLE, Study
from visavis.trial import TrialScript

NOMINAL_TRIAL_S: Final = 65.0

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
    columns=TRIALS,
    blocked_by="condition",
    practice=[{"condition": TRAINING, "configuration": TRAINING_CONFIGURATION}],
    parameters={k: v for k, v in asdict(DEFAULT_PARAMETERS).items() if k not in SETTABLE},
    intertrial_s=DEFAULT_PARAMETERS.intertrial_s,
    texts="texts",
    after_block=AFTER_BLOCK,
    questionnaires=AT_END,
    needs=("body_tracker", *BAND_ROLES),
    uses=lambda parameters: ("eye_tracker",) if parameters["record_gaze"] else (),
    spares=(*BAND_ROLES, "eye_tracker"),  # walks without are flagged
    people=lambda parameters: max_people(parameters["density_per_m2"]),
    calibrate=False,
    validate=False,
    folder=Path(__file__).parent,
)


@study.check
def check(parameters: Mapping[str, Any]) -> None:
    """Refuse parameters and levels that do not fit the crowd."""
    CrowdParameters.of(parameters)
    check_levels({"group": GROUPS, **parameters})


@study.older
def older(parameters: dict[str, Any]) -> dict[str, Any]:
    """Read how many crowds there were, and whether a control group, as levels of factors."""
    crowds = parameters.get("configurations")
    if type(crowds) is int and crowds in CROWDS:
        parameters["configuration"] = list(CROWDS[: parameters.pop("configurations")])
    if isinstance(parameters.get("with_control_group"), bool):
        is_wanted = parameters.pop("with_control_group")
        parameters["group"] = list(GROUPS) if is_wanted else [HAPTICS_GROUP]
    return parameters


@study.demands
def demands(parameters: Mapping[str, Any]) -> Demands:
    """Arms and hips tracked, the pattern within every band's reach, the floor of the crowd."""
    return Demands(
        segments=(*ARM_JOINTS, "hips"),
        vibrations=dict.fromkeys(BAND_ROLES, CrowdParameters.of(parameters).vibration),
        motors=MOTORS,
        floor_side_m=NEEDED_SIDE_M,
    )


@study.prepare
def prepare(parameters: Mapping[str, Any]) -> list[Callable[[], object]]:
    """Lay out every crowd and load the kernels of contact, which takes seconds."""
    params = CrowdParameters.of(parameters)

    def load(number: int) -> None:
        load_contact(laid_out(number, params.density_per_m2), params)

    numbers = (TRAINING_CONFIGURATION, *parameters.get("configuration", CROWDS))
    return [partial(load, number) for number in numbers]


@study.trial
def trial(t: TrialScript) -> Generator[Any, Any, Any]:
    """Walk through the crowd to the board and back; contact is answered at once."""
    if t.is_read:
        yield t.wait(NOMINAL_TRIAL_S)
        yield Show(standing(t.trial, t.density_per_m2))
        return {}
    moved = t.session_memory.setdefault("moved", set())
    params = CrowdParameters.of(t.settings.parameters)
    return (yield from run_trial(t.trial, params, moved, asked=t.text("questions.track")))


@study.intertrial
def empty_station(t: TrialScript) -> Plan:
    """Stand on the mark in the empty station."""
    return (yield from intertrial(t.trial, CrowdParameters.of(t.settings.parameters)))


@study.person
def person(index: int, seed: int, effect: bool, experiment: StudyExperiment) -> CrowdParticipant:
    """Return a simulated participant, fitted to the published speed."""
    return CrowdParticipant(index, seed, effect)


@study.views
def views(shown: Shown, experiment: StudyExperiment) -> Iterator[SceneFrame]:
    """Yield the views that a frame may have shown, the likeliest first."""
    yield from views_of(shown)


def plan_session(participant_index: int, seed: int, **parameters: Any) -> SessionPlan:
    """Plan a participant's session: one training walk, then the three blocks."""
    return StudyExperiment(study, parameters).plan(participant_index, seed)
