"""A figure moulded before a monitor or in a headset: to a mood, and after somebody beside it."""

from visavis import Compare, Factor, Live, Near, Slider, Study, walks
from visavis.protocol.plan.columns import Column

study = Study(
    "moulding_lab",
    "How active is a happy, and how active a sad walk?",
    factors=[Factor("mood", ["happy", "sad"])],
    calibrate=False,
    parameters={"beside_s": 60},
    compare=[Compare("activeness", within="mood")],
    columns=[
        Column("tries", "1", "movements that the trial got back"),
        Column("reached", "", "why the second figure was left"),
    ],
)
AT = {"slouch": [0.0], "shuffle": [0.25], "plain": [0.5], "bounce": [0.75], "march": [1.0]}
WALKS = walks("set_a", *AT)
LIVE = Live(WALKS, at=AT)
BESIDE = Live(WALKS, at=AT, beside="female_01", camera="still")
NEAR = Near({"march": 1.0}, within_m=0.03)


@study.trial
def trial(t):
    made = yield t.mould(LIVE, [Slider("activeness")], limit_s=60, caption=f"Make it {t.mood}.")
    reached = yield t.mould(BESIDE, [Slider("likeness")], until=NEAR, limit_s=t.beside_s)
    return {"tries": len(made.moves), "reached": reached.ended_by}


@study.answer
def answer(seen, response, rng):
    happy = seen.effect and "happy" in seen.caption
    return f"{min(1, max(0, rng.normal(0.75 if happy else 0.3, 0.15))):.2f}"
