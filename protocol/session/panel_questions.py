"""Ask questions on a board in the headset: looked at, pointed at, or answered by a key.

The answer is the label of an option, the same as typed at the terminal; questions without
options, or with too many for one board, go to the respondent there.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from visavis.protocol.people.simulated_participant import KeyPresser, SimulatedParticipant
from visavis.protocol.plan.experiment import Respondent
from visavis.protocol.plan.steps import FrameView, Show
from visavis.protocol.session.boards import (
    LEAVE_OUT_KEY,
    QUESTIONNAIRE,
    BoardAnswer,
    DwellRule,
    ask_on_board,
)
from visavis.protocol.session.frame_loop import FrameLoop
from visavis.recording.writer import Recorder
from visavis.stimuli.panels import SIZE_M, PanelFrame, board_before, choice_centre_m
from visavis.stimuli.picture import Panel
from visavis.stimuli.scene import Scene

MAX_CHOICES = 9
LEAVE_OUT = "no answer"


@dataclass(frozen=True)
class BoardWords:
    """What boards say besides their question: the choice that leaves it out, which keys take
    choices, which go on after an instruction, that there is a break, and that a scene comes.
    """

    leave_out: str = LEAVE_OUT
    keys: str = ""
    go_on: str = ""
    pause: str = ""
    coming: str = ""


class PanelRespondent:
    """Follow `Respondent`: boards for questions with options, `otherwise` for the rest.

    `participant` answers as it would at the terminal and looks at its choice; a person is given
    the board. `take_keys` returns the digits the operator pressed since the last call. Without
    an answer after `limit_s` the question goes to `otherwise`.
    """

    def __init__(
        self,
        loop: FrameLoop,
        recorder: Recorder,
        next_frame: Callable[[], FrameView],
        take_keys: Callable[[], Sequence[str]],
        otherwise: Respondent,
        blank: Callable[[], Scene],
        participant: SimulatedParticipant | None = None,
        *,
        rule: DwellRule | None = None,
        limit_s: float = 120.0,
        words: BoardWords | None = None,
    ) -> None:
        self._words = BoardWords() if words is None else words
        self._loop = loop
        self._recorder = recorder
        self._next_frame = next_frame
        self._take_keys = take_keys
        self._otherwise = otherwise
        self._blank = blank
        self._participant = participant
        dwell = DwellRule() if rule is None else rule
        self._ways = replace(QUESTIONNAIRE, limit_s=limit_s, dwell=dwell)

    def answer(self, question_id: str, prompt: str, options: Sequence[str]) -> str | None:
        """Return the label chosen; None when left out."""
        if not options or len(options) + 1 > MAX_CHOICES:
            return self._otherwise.answer(question_id, prompt, options)
        choices = (*options, self._words.leave_out)
        panel = board_before(
            self._loop.head, self._loop.surface, prompt, choices, hint=self._words.keys
        )
        if panel.keys:
            panel = replace(panel, keys=(*panel.keys[:-1], LEAVE_OUT_KEY))
        if self._participant is not None:
            label = self._otherwise.answer(question_id, prompt, options)
            looked_at = choices.index(label) if label in options else len(options)
            self._participant.look_at(choice_centre_m(panel, looked_at).tolist(), self._loop.t_ns)
            self._choose(looked_at if looked_at < len(options) else None)
        choice, by = self._ask(question_id, panel)
        if self._participant is not None:
            self._participant.look_at(None, self._loop.t_ns)
        self._loop.show_scene(self._blank())
        self._recorder.event("panel_answered", self._loop.t_ns, question=question_id, by=by)
        if choice is None:
            return self._otherwise.answer(question_id, prompt, options)
        return None if choice == len(options) else options[choice]

    # ---- private --------------------------------------------------------------------------

    def _choose(self, choice: int | None) -> None:
        """Let a simulated participant who answers by keys press that of a choice."""
        participant: object = self._participant
        if isinstance(participant, KeyPresser):
            participant.choose(choice, self._loop.t_ns)

    def _ask(self, question_id: str, panel: Panel) -> tuple[int | None, str]:
        """Show the board until something is chosen; return the choice and what chose it."""
        loop, scene = self._loop, self._blank()
        highlights: list[int | None] = [None]

        def show(view: FrameView, board: Panel) -> Show | None:
            if highlights[0] == board.highlighted:
                return None
            highlights[0] = board.highlighted
            return Show(_before(scene, loop.t_ns, board))

        self._take_keys()
        show_board(loop, self._recorder, question_id, panel, scene)
        asking = ask_on_board(panel, self._ways, None, show)
        step = next(asking)
        try:
            while True:
                view: FrameView | None = None
                if isinstance(step, Show):
                    loop.show(step.view)
                else:
                    view = self._next_frame()
                    controls = (*self._take_keys(), *view.pressed)
                    view = view._replace(pressed=controls, pressed_ns=())
                step = asking.send(view)
        except StopIteration as end:
            result: BoardAnswer = end.value
            return result.choice, "key" if result.by == "keys" else result.by


def show_board(
    loop: FrameLoop, recorder: Recorder, question_id: str, panel: Panel, scene: Scene
) -> None:
    """Show a board before a scene, and record it."""
    loop.show(_before(scene, loop.t_ns, panel))
    recorder.event(
        "panel_shown",
        loop.t_ns,
        question=question_id,
        choices=list(panel.choices),
        prompt=panel.text,
        position_m=panel.pose.position_m.tolist(),
        orientation_wxyz=panel.pose.orientation_wxyz.tolist(),
        **_design(panel),
    )


def _before(scene: Scene, t_ns: int, panel: Panel) -> PanelFrame:
    n = len(scene.agents)
    facing = np.array([a.facing for a in scene.agents]).reshape(n, 3)
    return PanelFrame(scene, t_ns, facing, np.ones(n), panels=(panel,))


def _design(panel: Panel) -> dict[str, Any]:
    """Return how a board differs from the usual one of a headset, for the recording."""
    if panel.size_m == SIZE_M and not panel.additions:
        return {}
    return {
        "size_m": list(panel.size_m),
        "rows": panel.rows,
        "keys": list(panel.keys),
        "ends": list(panel.ends),
        "hint": panel.hint,
    }
