"""Which of two people looks livelier, with the sides swapped from trial to trial."""

from visavis import Choice, Factor, Scene, Study

study = Study(
    "swapped",
    "Which of two people looks livelier?",
    factors=[Factor("waver_side", ["left", "right"])],
    repetitions=2,
    calibrate=False,
)


@study.trial
def trial(t):
    yield t.show(Scene("person", motion="wave"), seconds=0.3)
    means = ["waver", "other"] if t.waver_side == "left" else ["other", "waver"]
    yield t.ask(Choice("livelier", ["left", "right"], means=means))
    labels = ["me", "them"] if t.waver_side == "left" else ["them", "me"]
    yield t.ask(Choice("who", ["a", "b"], labels=labels))


@study.answer
def answer(seen, response, rng):
    return "left" if response.name == "livelier" else "a"
