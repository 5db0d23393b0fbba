"""How lively is a film, and which of two is livelier: films and pairs on a page, with a slider."""

from visavis import Choice, Compare, Factor, Film, Number, Pair, Rating, Scene, Study

study = Study(
    "films",
    "How lively does a person look on a film?",
    factors=[Factor("motion", ["idle", "wave"])],
    practice=1,
    parameters={"clip_s": 0.5},
    texts="film_texts",
    calibrate=False,
    on="browser",
    uses=(),
    questionnaires=["demographics"],
    compare=[Compare("lively", within="motion"), Compare("effort", within="motion")],
)


def film(t, motion):
    return Film(Scene("person", motion=motion), t.clip_s, size_px=(160, 160), rate_hz=30)


@study.trial
def trial(t):
    yield t.watch(film(t, t.motion), Rating("lively", 1, 5), caption=t.text("caption"))
    yield t.watch(
        Pair(film(t, t.motion), film(t, "idle")), Choice("livelier", ["left", "same", "right"])
    )
    yield t.ask(Number("effort", "%", 0, 100, step=1))


@study.answer
def answer(seen, response, rng):
    moves = seen.effect and seen.last.scene.people[0].does.__class__.__name__ == "Wave"
    if response.name == "lively":
        return int(min(5, max(1, round(rng.normal(4 if moves else 3, 1)))))
    if response.name == "effort":
        return f"{rng.uniform(0, 100):.0f}"
    return str(rng.choice(["left", "same"] if moves else ["left", "same", "right"]))
