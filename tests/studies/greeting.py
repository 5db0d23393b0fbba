from visavis import Choice, Compare, Exclusion, Factor, Rating, Scene, Study

study = Study(
    "greeting",
    "How approachable does a person seem who waves?",
    factors=[Factor("motion", ["idle", "wave"]), Factor("distance_m", [1.5, 3.0])],
    repetitions=1,
    practice=1,
    parameters={"person_s": 2.0},
    calibrate=False,
    exclusions=[
        Exclusion(
            "min_rating_ms",
            "trial",
            "approachable_ms",
            200,
            "answered too fast to have read the question",
            above=False,
        ),
    ],
    compare=[Compare("approachable", within=["motion", "distance_m"])],
)


@study.trial
def trial(t):
    yield t.dark(0.5)
    yield t.show(Scene("person", motion=t.motion, distance_m=t.distance_m), seconds=t.person_s)
    yield t.ask(Rating("approachable", 1, 7))
    yield t.ask(Choice("do", ["greet", "wait", "leave"]))


@study.answer
def answer(seen, response, rng):
    waves = seen.effect and seen.last.scene.name == "person_wave"
    if response.name == "do":
        return str(rng.choice(["greet", "wait"] if waves else ["wait", "leave"]))
    return int(min(7, max(1, round(rng.normal(5.5 if waves else 3.5, 1)))))
