"""How natural is a speaker with and without a moving body? Single clips, each seen once.

After Luo, Kipp and Neff: one speech in three parts, with no body, or a body whose gaps are filled
from a corpus or by interpolation and holds.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from visavis.experiments.gestures import published
from visavis.experiments.gestures.clips import (
    CHARACTER,
    FILLS,
    PART_S,
    PARTS,
    RATE_HZ,
    SPEAKERS,
    VERSIONS,
    clip_of,
    heard_from_s,
    mouth_from,
    speech_file,
)
from visavis.experiments.gestures.facts import OF_CLIPS, ORDERS_OF_CLIPS, WHERE
from visavis.experiments.gestures.viewing import looks_of
from visavis.protocol.plan.design import Factor
from visavis.stimuli.motion.kinds import Recorded
from visavis.stimuli.scenes.gathering import GatheringScene, Standing
from visavis.study.actions import Action
from visavis.study.careless_answers import Careless
from visavis.study.comparisons import Compare
from visavis.study.declaration import Study
from visavis.study.exclusions import COMPLETENESS_RULES
from visavis.study.films import Film, Lens, Voice
from visavis.study.responses import Rating, Response
from visavis.study.scenes import Scene, StagedScene, Staging, scene_of_people
from visavis.study.source import Source
from visavis.study.study_functions import Seen
from visavis.study.trial import TrialScript

CITATION: Final = (
    "Luo, P., Kipp, M., & Neff, M. Augmenting gesture animation with motion capture data to "
    "provide full-body engagement. UC Davis and DFKI."
)
AWAY_M: Final = 3.0
LENS: Final = Lens(eye_m=(0.5, 1.25, 0.0), aim_m=(0.0, 0.95, -AWAY_M), half_height_01=0.408)
FILM_PX: Final = (480, 640)
SAME_MOST: Final = 30

ONE_LEVEL: Final = (
    Factor("speech", ("own",)),
    Factor("sound_late_ms", (0,)),
    Factor("speaker", tuple(SPEAKERS)),
)
"""Further levels are for labs that ask what the match of body and speech is worth, or that have
several speakers."""

PERSON_SD: Final = 0.19
STILL_PERSON_SD: Final = 0.56
"""Viewers differ in what they feel, and more so about bodies that stand still."""
ERROR_SD: Final = 0.90

CARELESS: Final = Careless(
    "naturalness", max_same=SAME_MOST - 0.5, max_patterned_01=0.95, max_sound_failed=0
)
study = Study(
    "gestures",
    "Gestures with and without a moving body",
    "Does a speaker look more natural when weight and hips move with the gestures?",
    factors=[
        Factor("body", tuple(FILLS)),
        Factor("part", PARTS),
        Factor("version", VERSIONS),
        *ONE_LEVEL,
    ],
    order="random",
    cells=("body",),
    texts="texts",
    folder=Path(__file__).parent,
    on="browser",
    uses=(),
    calibrate=False,
    validate=False,
    screening=("sound",),
    questionnaires=("about_listeners",),
    exclusions=(*CARELESS.rules, *COMPLETENESS_RULES),
    columns=CARELESS.columns,
    compare=[
        Compare(
            "naturalness",
            within="body",
            claim="A speaker looks more natural with a moving body than without, and more so when "
            "it never stops",
            expects="corpus > holds > still",
        ),
        Compare(
            "naturalness",
            within="body",
            model="clmm",
            family="ordinal",
            exploratory=True,
            options=[("random", "body")],
            claim="The same on the scale of ratings",
            expects="corpus > holds > still",
        ),
    ],
    primary=("naturalness:body",),
    sections=["visavis.experiments.gestures.sections:ratings_as_printed"],
    source=Source(
        CITATION,
        published.PEOPLE,
        {"naturalness": {body: (m.mean, m.sd) for body, m in published.RATINGS.items()}},
        where=WHERE,
        facts=OF_CLIPS,
        orders=ORDERS_OF_CLIPS,
    ),
    methods=(
        "A speaker made the gestures of one speech of 33 s, in three parts, by the same arms and "
        "with three bodies: none, one whose gaps between gestures were filled by motion of a "
        "corpus, and one that interpolated and held there; the latter two in four versions each. "
        "The corpus was a synthetic speaker. Each of 36 films (480 × 640 pixels, 30 pictures a "
        "second, lips that move with the speech) was seen and heard once, in random order."
    ),
    references=(CITATION,),
)


@study.scene("speaking")
def speaking(
    staging: Staging, *, body: str, part: int, version: int, speaker: str, from_s: float
) -> StagedScene:
    """Return a speaker of a part of the speech, with a body; the lips say what is heard."""
    does = Recorded(clip_of(body, part, version, speaker), mouth_from(from_s))
    one = Standing(CHARACTER, "person", 0.0, -AWAY_M, 180.0, does, 7)
    return scene_of_people(staging, "speaking", (one,), "person", "averted")


def film_of(
    body: str,
    part: int,
    version: int,
    speech: str = "own",
    late_ms: float = 0.0,
    speaker: str = "synthetic",
) -> Film:
    """Return the film of a part; without a body every version is the same film.

    `speech` is `own`, or `other` for what is said in the next part; `late_ms` how much later than
    the body moves (below 0: sooner) it is heard.
    """
    shown_version = VERSIONS[0] if body == "still" else version
    from_s = heard_from_s(part, speech, late_ms)
    scene = Scene(
        "speaking", body=body, part=part, version=shown_version, speaker=speaker, from_s=from_s
    )
    voice = Voice(speech_file().name, from_s)
    return Film(scene, PART_S, FILM_PX, rate_hz=round(RATE_HZ), lens=LENS, voice=voice)


study.facts(CARELESS.facts)


@study.trial
def trial(t: TrialScript) -> Iterator[Action]:
    """Show a part of the speech once and have it rated."""
    film = film_of(t.body, int(t.part), int(t.version), t.speech, float(t.sound_late_ms), t.speaker)
    rating = Rating("naturalness", -2, 2)
    yield t.watch(film, rating, replay=False)


@study.answer
def answer(seen: Seen, response: Response, rng: np.random.Generator) -> int:
    """Rate by how much the body stands still and how it moves, whatever made it do so."""
    scene = None if seen.last is None else seen.last.scene
    latent, spread = 0.0, PERSON_SD
    if (
        seen.effect
        and isinstance(scene, GatheringScene)
        and isinstance(scene.people[0].does, Recorded)
    ):
        motion: Any = scene.people[0].does.motion
        looks = looks_of(motion, PART_S)
        latent, spread = looks.naturalness, PERSON_SD + STILL_PERSON_SD * looks.still_01
    opinion = latent + spread * seen.leaning + ERROR_SD * rng.standard_normal()
    return int(np.clip(round(opinion), -2, 2))
