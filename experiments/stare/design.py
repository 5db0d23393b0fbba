"""What one participant of the stare study will do, planned before anything runs."""

from dataclasses import asdict, dataclass, replace
from typing import Final

from lab.errors import DesignError
from protocol.design import Design, Factor, make_plan
from protocol.plan import Block, SessionPlan, Trial

STUDY: Final = "stare"
STUDY_VERSION: Final = "1"

AVERTED: Final = "A"
DIRECTED: Final = "D"
AVERTED_THEN_DIRECTED: Final = "AD"
DIRECTED_THEN_AVERTED: Final = "DA"
CONDITIONS: Final = (AVERTED, DIRECTED, AVERTED_THEN_DIRECTED, DIRECTED_THEN_AVERTED)
"""Where the active agent looks: away, at the participant, or first the one and then the other."""
DYNAMIC_CONDITIONS: Final = (AVERTED_THEN_DIRECTED, DIRECTED_THEN_AVERTED)

ZONES: Final = ("left", "centre", "right")
DEPTHS: Final = ("close", "middle", "far")
BLOCKS: Final = 3
QUESTIONNAIRES: Final = ("demographics", "social_anxiety", "free_comment")

TRAINING_INSTRUCTION: Final = (
    "In a moment you will sit in front of an audience that listens to a speaker. The speaker "
    "stands behind you, on your left, and does not talk. Take your time: look at the audience, "
    "look around, turn and see the speaker once. From then on your task is to face the audience "
    "and observe it; please do not turn to the speaker again. Between scenes the view goes dark "
    "for three seconds: bring head and eyes to the small mark at the top and keep them there."
)
FIRST_INSTRUCTION: Final = (
    "Now the first of three parts begins: 24 scenes of 16 seconds. Face the audience and observe "
    "it as you like; there is nothing to find and nothing to answer. Whenever it is dark, return "
    "head and eyes to the mark at the top."
)
SECOND_INSTRUCTION: Final = (
    "This is the second of three parts, with 24 scenes as before. Observe the audience as you "
    "like, and return to the mark at the top whenever it is dark. Say so if you need a pause."
)
THIRD_INSTRUCTION: Final = (
    "This is the last part, with 24 scenes as before. Observe the audience as you like, and "
    "return to the mark at the top whenever it is dark. Some questions follow at the end."
)
_INSTRUCTIONS = (FIRST_INSTRUCTION, SECOND_INSTRUCTION, THIRD_INSTRUCTION)


@dataclass(frozen=True)
class StareParameters:
    """What can be set in the study; the defaults are those of the source.

    `pad_deg` widens heads in the area-of-interest rule that decides a look online and offline;
    `look_trigger_ms` lets a gaze change wait after the look that causes it; without a look it
    comes at `switch_at_01` of the trial. `drain_ms` is how long the scene stays after the
    trial's end, at most, for samples taken before the end that have not arrived yet.
    """

    trial_s: float = 16.0
    intertrial_s: float = 3.0
    practice_s: float = 16.0
    repetitions: int = 2
    pad_deg: float = 1.0
    look_trigger_ms: float = 0.0
    switch_at_01: float = 0.5
    drain_ms: float = 50.0

    def __post_init__(self) -> None:
        if not (self.trial_s > 0 and self.intertrial_s >= 0 and self.practice_s > 0):
            raise DesignError(
                f"stare: trial_s {self.trial_s}, practice_s {self.practice_s} and intertrial_s "
                f"{self.intertrial_s} are durations; give seconds above 0 (intertrial_s from 0)"
            )
        if self.repetitions < 1:
            raise DesignError(f"stare: repetitions is {self.repetitions}; give at least 1")
        if not 0 < self.switch_at_01 < 1:
            raise DesignError(
                f"stare: switch_at_01 is {self.switch_at_01}; give a share of the trial between "
                "0 and 1"
            )
        if min(self.pad_deg, self.look_trigger_ms, self.drain_ms) < 0:
            raise DesignError("stare: pad_deg, look_trigger_ms and drain_ms cannot be negative")


DEFAULT_PARAMETERS: Final = StareParameters()


def design_of(params: StareParameters = DEFAULT_PARAMETERS) -> Design:
    """Return 4 conditions × 3 zones × 3 depths, repeated, in three balanced blocks."""
    return Design(
        study=STUDY,
        version=STUDY_VERSION,
        factors=(
            Factor("condition", CONDITIONS),
            Factor("zone", ZONES),
            Factor("depth", DEPTHS),
        ),
        repetitions=params.repetitions,
        blocks=BLOCKS,
        order="balanced_blocks",
        balanced=("condition", "zone", "depth"),
        practice=({"condition": AVERTED, "zone": "centre", "depth": "middle"},),
        practice_instruction=TRAINING_INSTRUCTION,
        questionnaires=QUESTIONNAIRES,
        parameters=asdict(params),
    )


def plan_session(
    participant_index: int,
    seed: int,
    *,
    group: str = "",
    params: StareParameters = DEFAULT_PARAMETERS,
) -> SessionPlan:
    """Plan a participant's session: training, then three blocks; pure.

    Raises DesignError for a group: everyone meets all conditions.
    """
    plan = make_plan(design_of(params), seed=seed, participant_index=participant_index, group=group)
    training, *blocks = plan.blocks
    return replace(
        plan,
        blocks=(
            replace(_with_places(training), name="Training"),
            *(
                replace(_with_places(block), instruction=instruction)
                for block, instruction in zip(blocks, _INSTRUCTIONS, strict=True)
            ),
        ),
    )


def _with_places(block: Block) -> Block:
    return replace(block, trials=tuple(_with_place(t) for t in block.trials))


def _with_place(trial: Trial) -> Trial:
    factors = trial.factors
    place = f"{factors['zone']}_{factors['depth']}"
    return replace(trial, factors={"condition": factors["condition"], "place": place, **factors})
