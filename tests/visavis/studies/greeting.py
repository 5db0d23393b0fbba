from visavis import Choice, Compare, Factor, Rating, Scene, Study

study = Study(
    "greeting",
    "How approachable does a person seem who waves?",
    factors=[Factor("motion", ["idle", "wave"])],
    repetitions=2,
    practice=1,
    parameters={"person_s": 2.0},
    calibrate=False,
    compare=[Compare("approachable", within="motion")],
)


@study.trial
def trial(t):
    yield t.dark(0.5)
    yield t.show(Scene("person", motion=t.motion, distance_m=2.0), seconds=t.person_s)
    yield t.ask(Rating("approachable", 1, 7))
    yield t.ask(Choice("do", ["greet", "wait", "leave"]))


@study.answer
def answer(seen, response, rng):
    waves = seen.effect and seen.last.scene.name == "person_wave"
    if response.name == "do":
        return str(rng.choice(["greet", "wait"] if waves else ["wait", "leave"]))
    return int(min(7, max(1, round(rng.normal(5.5 if waves else 3.5, 1)))))
