from visavis import Factor, Scene, Study

study = Study(
    "asking",
    "Who takes part?",
    factors=[Factor("eyes", ["averted", "directed"])],
    questionnaires=["demographics"],
    calibrate=False,
)


@study.trial
def trial(t):
    yield t.show(Scene("two_people", eyes=t.eyes), seconds=0.2)
