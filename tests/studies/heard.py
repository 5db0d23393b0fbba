"""Is somebody lively who is heard? A film without replay, and a pair of which one is heard."""

from visavis import Choice, Factor, Film, Pair, Rating, Scene, Study, Voice

SPEECH = "../../experiments/gestures/speech.wav"
study = Study(
    "heard",
    "Films that are heard",
    factors=[Factor("motion", ["idle"])],
    repetitions=2,
    parameters={"clip_s": 2.0, "from_s": 2.5, "speaker": "active"},
    on="browser",
    uses=(),
    calibrate=False,
    screening=("sound",),
)


def film(t):
    voice = Voice(SPEECH, t.from_s, t.speaker)
    scene = Scene("person", motion=t.motion)
    return Film(scene, t.clip_s, size_px=(96, 96), rate_hz=30, voice=voice)


@study.trial
def trial(t):
    yield t.watch(film(t), Rating("lively", 1, 5), replay=False)
    yield t.watch(Pair(film(t), film(t)), Choice("livelier", ["left", "same", "right"]))


@study.answer
def answer(seen, response, rng):
    return 3 if response.name == "lively" else "same"
