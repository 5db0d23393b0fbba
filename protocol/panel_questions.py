"""Ask questions on a board in the headset: looked at, pointed at, or answered by a key.

The answer is the label of an option, the same as typed at the terminal; questions without
options, or with too many for one board, go to whoever answers there.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lab.clock import NS_PER_MS
from lab.geometry import rotate
from protocol.experiment import Respondent
from protocol.frame_loop import FrameLoop
from protocol.participants import SimulatedParticipant
from protocol.steps import FrameView
from recording.writer import Recorder
from stimuli.panels import SIZE_M, PanelFrame, choice_centre_m, choice_met, placed_before
from stimuli.picture import Panel
from stimuli.scene import Scene

MOST_CHOICES = 9
LEAVE_OUT = "no answer"
CONFIRM = frozenset({"trigger", "select"})
"""Controls that take the choice pointed at (or looked at, where no controller points)."""
LEAVE_OUT_KEY = "0"


@dataclass(frozen=True)
class DwellRule:
    """How long a choice must be looked at; gaze lost or elsewhere for `gap_ms` begins anew."""

    dwell_ms: int = 1200
    gap_ms: int = 150


class GazeDwell:
    """Follow which choice is being looked at, and for how long."""

    def __init__(self, rule: DwellRule) -> None:
        self._rule = rule
        self.choice: int | None = None
        self._since_ns = self._last_ns = 0

    def take(self, choice: int | None, t_ns: int) -> int | None:
        """Take one gaze sample; return the choice once it has been looked at long enough."""
        is_anew = t_ns - self._last_ns > self._rule.gap_ms * NS_PER_MS  # or no sample came
        if choice is not None and (is_anew or choice != self.choice):
            self.choice, self._since_ns = choice, t_ns
        if choice is not None:
            self._last_ns = t_ns
        elif is_anew:
            self.choice = None
        if self.choice is None or choice is None:
            return None
        return choice if t_ns - self._since_ns >= self._rule.dwell_ms * NS_PER_MS else None


class PanelRespondent:
    """Follow `Respondent`: boards for questions with options, `otherwise` for the rest.

    `participant` answers as it would at the terminal and looks at its choice; a person is given
    the board. `take_keys` returns the digits the operator pressed since the last call. Without
    an answer after `limit_s` the question goes to `otherwise`. `leave_out` is what the choice is
    called with which a question is left out.
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
        leave_out: str = LEAVE_OUT,
    ) -> None:
        self._leave_out = leave_out
        self._loop = loop
        self._recorder = recorder
        self._next_frame = next_frame
        self._take_keys = take_keys
        self._otherwise = otherwise
        self._blank = blank
        self._participant = participant
        self._rule = DwellRule() if rule is None else rule
        self._limit_ns = round(limit_s * 1000) * NS_PER_MS

    def answer(self, question_id: str, prompt: str, options: Sequence[str]) -> str | None:
        """Return the label chosen; None when left out."""
        if not options or len(options) + 1 > MOST_CHOICES:
            return self._otherwise.answer(question_id, prompt, options)
        choices = (*options, self._leave_out)
        panel = Panel(prompt, choices, placed_before(self._loop.head), SIZE_M)
        if self._participant is not None:
            wanted = self._otherwise.answer(question_id, prompt, options)
            looked_at = choices.index(wanted) if wanted in options else len(options)
            self._participant.look_at(choice_centre_m(panel, looked_at).tolist(), self._loop.t_ns)
        chosen, by = self._ask(question_id, panel)
        if self._participant is not None:
            self._participant.look_at(None, self._loop.t_ns)
        self._loop.show_scene(self._blank())
        self._recorder.event("panel_answered", self._loop.t_ns, question=question_id, by=by)
        if chosen is None:
            return self._otherwise.answer(question_id, prompt, options)
        return None if chosen == len(options) else options[chosen]

    # ---- private --------------------------------------------------------------------------

    def _ask(self, question_id: str, panel: Panel) -> tuple[int | None, str]:
        """Show the board until something is chosen; return the choice and what chose it."""
        loop, dwell, scene = self._loop, GazeDwell(self._rule), self._blank()
        self._take_keys()
        self._show(scene, panel)
        self._recorder.event(
            "panel_shown", loop.t_ns, question=question_id, choices=list(panel.choices)
        )
        view = self._next_frame()
        shown_ns = view.t_ns
        end_ns = shown_ns + self._limit_ns
        # What this frame brings was done before the board was there: after a pause, much.
        self._take_keys()
        view = replace(view, pressed=())
        lit: int | None = None
        while view.t_ns < end_ns:
            for key in (*self._take_keys(), *(c for c in view.pressed if c.isdigit())):
                chosen = _of_key(key, len(panel.choices))
                if chosen is not None:
                    return chosen, "key"
            pointed = _pointed_at(panel, view)
            looked = dwelt(dwell, panel, view, shown_ns)
            now_lit = dwell.choice if pointed is None else pointed
            if now_lit is not None and CONFIRM.intersection(view.pressed):
                return now_lit, "gaze and button" if pointed is None else "ray"
            if looked is not None and pointed is None:
                return looked, "gaze"
            if now_lit != lit:
                lit = now_lit
                self._show(scene, replace(panel, highlighted=lit))
            view = self._next_frame()
        return None, "nothing in time"

    def _show(self, scene: Scene, panel: Panel) -> None:
        n = len(scene.agents)
        facing = np.array([a.facing for a in scene.agents]).reshape(n, 3)
        self._loop.show(PanelFrame(scene, self._loop.t_ns, facing, np.ones(n), panels=(panel,)))


def dwelt(dwell: GazeDwell, panel: Panel, view: FrameView, since_ns: int) -> int | None:
    """Take a frame's gaze samples from `since_ns` on; return what was looked at long enough."""
    gaze = view.gaze
    for i in range(gaze.t_ns.shape[0]):
        if gaze.t_ns[i] < since_ns:
            continue
        met = None
        if gaze.valid[i]:
            met = choice_met(panel, gaze.origin_world_m[i], gaze.direction_world[i])
        chosen = dwell.take(met, int(gaze.t_ns[i]))
        if chosen is not None:
            return chosen
    return None


def _pointed_at(panel: Panel, view: FrameView) -> int | None:
    for ray in view.pointers:
        forward = rotate(ray.orientation_wxyz, np.array([0.0, 0.0, -1.0]))
        met = choice_met(panel, ray.position_m, forward)
        if met is not None:
            return met
    return None


def _of_key(key: str, n: int) -> int | None:
    """Return the choice of a digit: 1 is the first, 0 the last (no answer)."""
    if key == LEAVE_OUT_KEY:
        return n - 1
    number = int(key) if key.isdigit() else 0
    return number - 1 if 1 <= number < n else None
