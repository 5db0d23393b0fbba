from visavis import Compare, Factor, Rating, Scene, Study, dwell_on

study = Study(
    "duel",
    "Whom do people look at?",
    factors=[Factor("gaze", ["averted", "directed"]), Factor("side", ["left", "right"])],
    repetitions=5,
    practice=2,
    texts="texts",  # texts/en.yaml, texts/de.yaml … with {trial_s}, {trials}
    measures=[dwell_on("active")],
    compare=[Compare("dwell_ms", within="gaze")],
)


@study.trial
def trial(t):
    yield t.dark(1.0)
    yield t.show(Scene("two_people", active=t.side, eyes=t.gaze), seconds=4)
    yield t.ask(Rating("realism", 1, 9))
