"""A short path through the waving study: the same waves, eyes, people and judgements, no frames.

What can be seen of each of the 54 waves is rendered once, by the code of a session, and kept; every
person then reads it anew. The head stands still where a customer's is supposed, so the loop, which
corrects a participant's own wave for their tracked head, has nothing to correct.
"""

from collections.abc import Iterator
from functools import cache
from itertools import product
from typing import TYPE_CHECKING, Any, Final

import visavis.experiments.waving
import visavis.stimuli.motion.warping
from visavis.experiments.waving import clips
from visavis.experiments.waving.perception import Evidence, evidence_of, reach_view
from visavis.lab.array_cache import digest_of, digest_of_code, read_cache, write_cache
from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Vector
from visavis.protocol.plan.session_plan import SessionPlan, Trial
from visavis.stimuli.dressing.office import PARTS as ROLES
from visavis.stimuli.dressing.office import office_eyes, office_scene, roles_of
from visavis.stimuli.dressing.office_view import body_mesh, eye_at, seen_body_of
from visavis.stimuli.motion.warping.outlook import Outlook
from visavis.stimuli.rooms.office import office
from visavis.stimuli.scenes.office import (
    CLERKS,
    CUSTOMERS,
    PARTICIPANT_PLACES,
    Waving,
    neighbour,
    shift_m,
)

if TYPE_CHECKING:
    from visavis.experiments.waving.participant import WavingParticipant

Stimulus = tuple[str, str, str, str]
STIMULI: Final = tuple(
    product(clips.TECHNIQUES, clips.DIRECTIONS, clips.CLERK_NAMES, PARTICIPANT_PLACES)
)
"""The 54 situations of the study: technique, direction, clerk, participant's place."""


def quick_trials(
    person: "WavingParticipant", plan: SessionPlan, making: clips.Making = clips.DEFAULT_MAKING
) -> Iterator[tuple[Trial, dict[str, Any]]]:
    """Perform every trial of a plan but practice; yield its answers and how long they took."""
    for trial in plan.trials:
        if trial.is_practice:
            continue
        technique, direction, clerk, place = (
            str(trial.factors[name])
            for name in ("technique", "direction", "clerk", "participant_place")
        )
        evidence = evidence_for((technique, direction, clerk, place), making)
        judgement = person.judges(evidence, place, trial.number)
        who = clips.PLACES[judgement.place]
        yield (
            trial,
            {
                "who": who,
                "is_right": who == str(trial.factors["target_place"]),
                "realism": judgement.realism,
                "who_ms": 1000.0 * judgement.who_s,
                "realism_ms": 1000.0 * judgement.realism_s,
            },
        )


@cache
def evidence_for(stimulus: Stimulus, making: clips.Making = clips.DEFAULT_MAKING) -> Evidence:
    """Return what a customer who stands still sees of a wave; rendered once on a computer."""
    technique, direction, clerk, place = stimulus
    target = neighbour(place, direction).name
    wave = clips.study_wave(clerk, target, technique, making)
    key = digest_of(text=f"{stimulus} {making} {wave.sha256} {surroundings_sha256()}")
    file_arrays = read_cache(clips.KEPT_AS, key)
    if file_arrays is not None:
        return Evidence(**file_arrays)
    gaze = gaze_of(wave.waving, place, target)
    evidence = evidence_of(wave.waving, place, eye_at(place), gaze)
    write_cache(clips.KEPT_AS, key, vars(evidence))
    return evidence


def gaze_of(waving: Waving, participant_place: str, target_place: str) -> Vector:
    """Return where the waving clerk's eyes point (3,), at a participant who stands still."""
    scene = office_scene(participant_place, waving, clips.SCENE_SEED)
    eyes = office_eyes(scene, target_place, 0, 1.0, 0.0)
    standing = eye_at(participant_place) + shift_m(participant_place)
    gaze, _, _ = eyes.at(10 * NS_PER_S, standing)
    pointing: Vector = gaze[roles_of(participant_place).index(waving.clerk)]
    return pointing


def _arrays_of(view: Outlook) -> tuple[Vector, ...]:
    lighting = view.lighting
    return view.eye, view.behind, lighting.lamps, lighting.maps, lighting.map_eyes


@cache
def surroundings_sha256() -> str:
    """Return the hash of everything that decides what can be seen of a given wave."""
    views = [reach_view(clerk.name, customer.name) for clerk in CLERKS for customer in CUSTOMERS]
    meshes = [p.mesh for p in office().props] + [body_mesh(role) for role in ROLES]
    bodies = [seen_body_of(c.name) for c in CLERKS]
    code = map(digest_of_code, (visavis.experiments.waving, visavis.stimuli.motion.warping))
    return digest_of(
        *(part for v in views for part in _arrays_of(v)),
        *(m.vertices_m for m in meshes),
        *(part for b in bodies for part in (b.rest, b.joints, b.weights, b.triangles, b.labels)),
        text=" ".join((*code, *(f"{v.lighting.ambient} {v.lighting.least_light}" for v in views))),
    )
