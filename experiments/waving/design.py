"""What one participant of the waving study will do, planned before anything runs."""

from dataclasses import asdict, dataclass, replace
from typing import Final

from lab.errors import DesignError
from protocol.design import Design, Factor, make_plan
from protocol.plan import SessionPlan, Trial
from stimuli.scenes.office import CLERKS, PARTICIPANT_PLACES, neighbour

STUDY: Final = "waving"
STUDY_VERSION: Final = "1"

ORIENTATION: Final = "orientation"
WARPING: Final = "warping"
TECHNIQUES: Final = (ORIENTATION, WARPING)
"""The whole body turned towards the addressee, or the same wave warped to the addressee's view."""
DIRECTIONS: Final = ("self", "left", "right")
"""Who is waved at: the participant, the customer to the left, the customer to the right."""
QUESTIONNAIRES: Final = ("demographics", "strategy", "free_comment")
ANSWER_WAYS: Final = ("ray", "keyboard")

TRAINING_INSTRUCTION: Final = (
    "You stand in a line of five customers in an office. Three clerks sit at desks in front of "
    "you. In every scene one of them waves at somebody in the line: at you, or at somebody beside "
    "you. After the scene you say to whom the clerk waved, and how realistic it looked from 1 to "
    "9. Point at an answer and pull the trigger. Two scenes to try come first."
)
INSTRUCTION: Final = (
    "Now the scenes that count. Between scenes the view goes dark for a moment and you may be put "
    "at another place in the line; say so whenever you want a break."
)


@dataclass(frozen=True)
class WavingParameters:
    """What can be set in the study.

    Times in seconds: the scene is there `before_s` before the hand is up, the wave lasts `wave_s`.
    `increment` is how much more coverage of head and hand the warped wave shall have, `warp_from`
    what it starts from: the wave "oriented" to the addressee, or the one to the "front".
    Answers come by "ray" or "keyboard"; a ray that has not answered after `answer_limit_s` gives
    over to the operator. With fewer `clerks` than three the others never wave: a pilot.
    """

    before_s: float = 1.0
    wave_s: float = 2.6
    after_s: float = 0.6
    intertrial_s: float = 1.5
    increment: float = 0.25
    warp_from: str = "oriented"
    answer_by: str = "ray"
    answer_limit_s: float = 30.0
    blocks: int = 3
    clerks: int = 3

    def __post_init__(self) -> None:
        problems = []
        if min(self.before_s, self.wave_s, self.after_s, self.answer_limit_s) <= 0:
            problems.append("before_s, wave_s, after_s and answer_limit_s are above 0")
        if self.intertrial_s < 0:
            problems.append("intertrial_s cannot be negative")
        if not 0 <= self.increment <= 2:
            problems.append(f"increment {self.increment} is no share from 0 to 2")
        if self.warp_from not in ("oriented", "front"):
            problems.append(f"warp_from {self.warp_from!r} is neither oriented nor front")
        if self.answer_by not in ANSWER_WAYS:
            problems.append(f"answer_by {self.answer_by!r} is none of {', '.join(ANSWER_WAYS)}")
        if self.blocks not in (1, 2, 3, 6):
            problems.append("blocks is 1, 2, 3 or 6, so that they are equally long")
        if not 1 <= self.clerks <= len(CLERKS):
            problems.append(f"clerks is 1 to {len(CLERKS)}")
        if problems:
            raise DesignError(f"waving: {'; '.join(problems)}")

    @property
    def scene_s(self) -> float:
        """From the scene's onset to the first question."""
        return self.before_s + self.wave_s + self.after_s


DEFAULT_PARAMETERS: Final = WavingParameters()


def design_of(params: WavingParameters = DEFAULT_PARAMETERS) -> Design:
    """Return 2 techniques × 3 directions × 9 situations (clerk by own place), shuffled."""
    return Design(
        study=STUDY,
        version=STUDY_VERSION,
        factors=(
            Factor("technique", TECHNIQUES),
            Factor("direction", DIRECTIONS),
            Factor("clerk", tuple(c.name for c in CLERKS[: params.clerks])),
            Factor("participant_place", PARTICIPANT_PLACES),
        ),
        blocks=params.blocks,
        order="random",
        practice=(
            {
                "technique": ORIENTATION,
                "direction": "self",
                "clerk": CLERKS[params.clerks // 2].name,
                "participant_place": "place_3",
            },
            {
                "technique": WARPING,
                "direction": "left",
                "clerk": CLERKS[0].name,
                "participant_place": "place_3",
            },
        ),
        practice_instruction=TRAINING_INSTRUCTION,
        instruction=INSTRUCTION,
        calibrate_blocks=False,
        calibrate_practice=True,
        questionnaires=QUESTIONNAIRES,
        parameters=asdict(params),
    )


def plan_session(
    participant_index: int,
    seed: int,
    *,
    group: str = "",
    params: WavingParameters = DEFAULT_PARAMETERS,
) -> SessionPlan:
    """Plan a participant's session: two training trials, then 54; pure.

    Raises DesignError for a group: everyone meets all conditions.
    """
    plan = make_plan(design_of(params), seed=seed, participant_index=participant_index, group=group)
    return replace(
        plan,
        blocks=tuple(
            replace(
                block,
                name="Training" if block.index == 0 else f"Part {block.index} of {params.blocks}",
                trials=tuple(map(_with_target, block.trials)),
            )
            for block in plan.blocks
        ),
    )


def _with_target(trial: Trial) -> Trial:
    target = neighbour(str(trial.factors["participant_place"]), str(trial.factors["direction"]))
    return replace(trial, factors={**trial.factors, "target_place": target.name})
