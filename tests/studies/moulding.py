"""How active must a walk be to look happy: a figure on a page that one slider moulds."""

from visavis import Compare, Factor, Live, Slider, Study, walks
from visavis.protocol.plan.columns import Column

study = Study(
    "moulding",
    "How active is a happy, and how active a sad walk?",
    factors=[Factor("mood", ["happy", "sad"])],
    practice=1,
    texts="moulding_texts",
    calibrate=False,
    on="browser",
    uses=(),
    columns=[Column("tries", "1", "movements that the trial got back")],
    compare=[Compare("activeness", within="mood")],
)
ACTIVENESS = {"slouch": [0.0], "shuffle": [0.25], "plain": [0.5], "bounce": [0.75], "march": [1.0]}
LIVE = Live(walks("set_a", *ACTIVENESS), at=ACTIVENESS)


@study.trial
def trial(t):
    made = yield t.mould(
        LIVE, [Slider("activeness")], limit_s=60, caption=t.text(f"captions.{t.mood}")
    )
    return {"tries": len(made.moves)}


@study.answer
def answer(seen, response, rng):
    if response.name == "activeness":
        happy = seen.effect and "happy" in seen.caption
        return f"{min(1, max(0, rng.normal(0.75 if happy else 0.3, 0.15))):.2f}"
    return str(response.options[0])
