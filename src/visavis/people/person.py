"""The simulated person of a study on the kit: looks at people, points, presses, and answers.

They see only the display and hear the questions. Their answers come from the study's own function
of what was `Seen`, or are neutral.
"""

import math
import zlib
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.aoi import DEFAULT_PAD_DEG
from visavis.lab.chance import generator
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DataError
from visavis.lab.geometry import Pose, Vector, quat_conjugate, rotate, unit, yaw_pitch_deg_of
from visavis.lab.screen import FlatScreen, PlacedScreen
from visavis.people.body import PointingHand, hand_alone, segments_of
from visavis.people.body_kernels import POINT_S
from visavis.people.ears import Ears
from visavis.people.moulder import (
    KEY_S,
    LOOK_S,
    Movement,
    Outcome,
    Task,
    guess,
    guess_by_any,
    made_in_turn,
    match,
    match_by_any,
    presses,
)
from visavis.people.observer import DEFAULT_POPULATION, Observer, Population
from visavis.people.observer.observer import MOVES_NS, Layout
from visavis.people.observer.picture_layout import (
    PictureLayout,
    areas_in_window,
    hidden_areas,
)
from visavis.people.observer.room_layout import RoomLayout
from visavis.people.observer.state import HEAD, ROOM, SPEAKER_SIDE
from visavis.protocol.session.boards import HAND, keys_of_choice
from visavis.stimuli.areas import SurroundingAreas
from visavis.stimuli.gaze_window import WindowPlace
from visavis.stimuli.motion.synthesis.pose_distance import Likeness, compared_joints
from visavis.stimuli.moving_heads import agents_at
from visavis.stimuli.panels import PanelFrame, Surface, choice_centre_m, place_m, track_01
from visavis.stimuli.picture import Panel
from visavis.stimuli.room_shape import areas_of_room, seen_of_room
from visavis.stimuli.scene import Scene, SceneFrame
from visavis.stimuli.scenes.flat import FlatScene
from visavis.stimuli.view_turns import ARROWS, MAX_PITCH_DEG, STEP_DEG, ViewTurns
from visavis.study.distances import WhenNear
from visavis.study.gaze_on import WhenGazeOn
from visavis.study.live import Live, LiveScene, Moulding
from visavis.study.moulding import MouldingFrame, press_step
from visavis.study.race import Race
from visavis.study.responses import (
    Choice,
    FreeText,
    Keys,
    Number,
    Pointing,
    Rating,
    Response,
    SideBySide,
)
from visavis.study.scenes import areas_of
from visavis.study.study_functions import AnswerOf, Seen

if TYPE_CHECKING:
    from visavis.study.moving_camera import FilmSeen

_MIND_STREAM, _LEANING_STREAM, _PACE_STREAM, _MOULD_STREAM, _POINTER_STREAM = 11, 12, 13, 14, 15
_TURN_STREAM = 16
HAND_AT_M: Final = (0.26, -0.42, -0.30)
"""Position of the pointing right hand, relative to the eyes."""
HAND_REST: Final = (0.30, -0.85, -1.0)
"""Point that the hand points to before a question, relative to the eyes."""
SEED_STEP: Final = 1_000_003
"""By how much the seed of what is simulated differs from one session of a person to the next."""
PRESS_S: Final = 0.1
LOOK_STEP_NS: Final = 10_000_000
"""Length of the steps in which people foresee where they will look."""
POINTER_STOP_S: Final = 0.6
"""How long a pointer rests on what it reveals."""
AROUND_REACH: Final = 3.0
"""How much farther gaze goes at a time in a panorama than among people; our estimate."""
TURN_S: Final = 2.0
"""How long somebody looks at a part of a panorama before they turn the view."""
STEP_S: Final = 0.25
"""Time between two presses on the way to a choice."""
THINKING_S: Final = 1.1
THINKING_LOG_SD: Final = 0.3
PACE_LOG_SD: Final = 0.2
"""How much people differ in the pace at which they mould figures."""
CLOSE_01: Final = 0.95
"""Of the distance that counts as reached: a hand does not point to a hair."""
NOTICE_S: Final = 0.32
"""Time from an onset to a press without a decision, in seconds."""
LISTEN_S: Final = 0.2
"""For how long somebody listens before they judge what they hear; less, if it is over before."""
CONTACT_DEG: Final = 5.0
FITTED_PEOPLE: Final = 11
"""Number of people in the scene to which the model of attention was fitted."""


class StudyPerson(Observer):
    """An `Observer` who also answers: by ray and trigger on boards, by keys, in words.

    `words` maps the text of a board to the response that it asks for. `visit` counts the sessions
    of a person: leanings stay, chance does not.
    """

    _panel_text: str
    _films: "Mapping[str, FilmSeen]"
    _live: Live | None
    _caption: str
    _figures: LiveScene | None
    _moulding: Moulding | None
    _listens_for: tuple[Keys, ...]
    _looks_around: bool
    _turned_deg: tuple[float, float]
    _goal_deg: tuple[float, float]
    _turns: int
    _familiar_areas: frozenset[str]
    """Areas that a window which follows gaze has uncovered in what is shown."""
    _search: WhenGazeOn | None
    """What they look for in what is shown, to press when they look at it."""
    _search_ends_ns: int
    _search_press_ns: int | None
    _search_plan: int
    """The `plan_number` for which it is foreseen when they come to look at it."""

    def __init__(
        self,
        index: int,
        seed: int,
        effect: bool = True,
        *,
        responses: Mapping[str, Response],
        answer_of: AnswerOf | None = None,
        population: Population = DEFAULT_POPULATION,
        visit: int = 1,
    ) -> None:
        self._responses = responses
        self._answer_of = answer_of or neutral_answer
        of_person = (seed - SEED_STEP * (visit - 1), index)
        self._leaning = float(generator(of_person, _LEANING_STREAM).standard_normal())
        self._visit = visit
        self._board_controls: tuple[str, ...] = ()
        self._forget()
        super().__init__(index, seed, effect, population=population)

    # ---- SimulatedParticipant ----

    def prepare(self, stretch: int, t_ns: int) -> None:
        """Begin a new stretch of behaviour: nothing seen, the hand down, no board to look at."""
        if self._panel_text:
            self._instructed_point = None
        super().prepare(stretch, t_ns)
        self._forget()

    def answer(self, question_id: str, prompt: str, options: Sequence[str]) -> str | None:
        """Answer a question at the terminal; None when this person would leave it out."""
        response = self._responses.get(prompt)
        if response is None:
            return super().answer(question_id, prompt, options)
        reply = self._reply_to(response)
        if reply is None:
            return None
        return options[list(response.options).index(reply)] if response.options else str(reply)

    # ---- Viewer ----

    def see(self, view: SceneFrame, t_display_ns: int) -> None:
        """Receive what the display shows from `t_display_ns` on."""
        if isinstance(view, MouldingFrame):
            self._see_figure(view, t_display_ns)
            return
        if self._moulding is not None:
            self._moulding = None
            self._hand.press_no_more()
            self.look_at(None, t_display_ns)
        if isinstance(view, PanelFrame) and view.panels:
            panel = view.panels[0]
            if panel.text != self._panel_text:
                self._panel_text = panel.text
                self._decide(panel, t_display_ns)
            return
        if self._panel_text:
            self._panel_text = ""
            self.look_at(None, t_display_ns)
        if self._looks_around and view.scene is not self._scene:
            self._looks_around = False
            self._hand.press_no_more(ARROWS)
        super().see(view, t_display_ns)
        if view.scene.brightness_01 > 0:
            self._take_in(view, t_display_ns)
        scene = view.scene
        if isinstance(scene, FlatScene) and scene.panorama is not None:
            self._look_around(scene, view.turned_deg, t_display_ns)
        if isinstance(scene, FlatScene) and view.window_at is not None:
            self._uncover(scene, view.window_at)
        if self._search is not None:
            self._foresee_press(self._search, t_display_ns)

    # ---- Body ----

    # What a person here sees beyond an observer ends in looks and presses, which tell themselves.
    heads_ahead, eyes_ahead = Observer.heads_ahead, Observer.eyes_ahead

    def presses(self, until_ns: int) -> Iterator[tuple[int, str, float]]:
        """Yield presses and releases since the last call."""
        return self._hand.presses(until_ns)

    def next_press_ns(self) -> int | None:
        """Return the time of the next press or release."""
        return self._hand.next_press_ns()

    def segments(
        self, names: Sequence[str], t_ns: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return true positions (t, n, 3) and orientations (t, n, 4) of segments in world."""
        t_s = (t_ns - self._origin_ns) / NS_PER_S
        hand_m = np.broadcast_to(self._seat + np.array(HAND_AT_M), (len(t_s), 3))
        pointed_m = self._seat + self._hand.pointed_at(t_s)
        if tuple(names) == (HAND,):
            return hand_alone(hand_m, pointed_m)
        _, eyes_m, turn = self.sense(t_ns)
        return segments_of(names, self._seat, eyes_m, turn, hand_m, pointed_m)

    def watch(self, films: "Mapping[str, FilmSeen]") -> None:
        """See films by moving cameras on a page, by their place on the page."""
        self._films = films

    def watch_figures(self, scene: LiveScene, caption: str) -> None:
        """Look at live figures, with what stands above them."""
        self._figures, self._caption = scene, caption

    def mould(self, live: Live, caption: str) -> None:
        """Sit before a live figure on a page, with what stands above it."""
        self._live, self._caption = live, caption

    def mould_to(self, task: Task, *, within_m: float, limit_s: float, is_blind: bool) -> Outcome:
        """Move sliders until a figure looks like another, or guess where it is not seen."""
        rng = self._rng(_MOULD_STREAM, self.stretch(), int(is_blind))
        pace = self.pace
        if self.notices_contact:
            if is_blind:
                return guess(task, limit_s, pace, rng)
            return match(task, within_m, limit_s, pace, rng)
        by_any = guess_by_any if is_blind else match_by_any
        return by_any(task, within_m, limit_s, pace, rng)

    @property
    def pace(self) -> float:
        """How long this person takes to mould something, times the usual."""
        return float(np.exp(PACE_LOG_SD * self._leaning))

    def feel(self, role: str, amplitudes_01: Sequence[float], t_ns: int) -> None:
        """Feel a vibration, on which answers may depend."""
        if any(a > 0 for a in amplitudes_01) and role not in self._vibrating_roles:
            self._vibrating_roles.append(role)

    def press(self, response: Keys) -> tuple[str | None, float]:
        """Return the key pressed for what is seen on a page, and after how many seconds."""
        reply, takes_s = self._timed_reply_to(response)
        usual_s = NOTICE_S * self.takes_s(response) / THINKING_S
        return reply, usual_s if takes_s is None else takes_s

    def hear(self, samples: npt.NDArray[np.float32], rate_hz: int, t_ns: int) -> None:
        """Hear a block of samples (n, 2); press once enough was heard of what asks for a key."""
        self._ears.hear(samples, rate_hz, t_ns)
        if not self._listens_for or not self._ears.hears_new:
            return
        end_ns = t_ns + round(len(samples) / rate_hz * NS_PER_S)
        if samples.any() and end_ns - self._ears.began_ns < LISTEN_S * NS_PER_S:
            return
        responses, self._listens_for = self._listens_for, ()
        for response in responses:
            reply, takes_s = self.press(response)
            if reply is not None:
                at_ns = self._ears.began_ns + round(takes_s * NS_PER_S)
                self._hand.press(max(at_ns, end_ns), reply)

    def pointer_path(self, scene: FlatScene, seconds: float) -> list[tuple[float, float, float]]:
        """Return where this person moves a pointer over a picture with areas of interest: from when
        on, in seconds, and degrees to the right and upwards.
        """
        if not areas_of(scene):
            return []
        layout, stops = self._pointer_stops(scene, seconds)
        path = []
        for t_s, place in stops:
            x, y, z = layout.targets["direction"][place].tolist()
            right_deg, up_deg = (float(np.degrees(np.arctan2(v, -z))) for v in (x, y))
            path.append((t_s, right_deg, up_deg))
        return path

    def before_eyes(self, screen: FlatScreen) -> Surface:
        """Return the screen of a page upright before this person's eyes."""
        upright = Pose(self._seat, np.array([1.0, 0.0, 0.0, 0.0]))
        return Surface(PlacedScreen(screen, upright))

    def view_turns(self, seconds: float, frame_ns: int) -> ViewTurns:
        """Return how this person turns the view onto the panorama on a page that they have just
        seen, in the rhythm of its frames: times count from its onset.
        """
        turns, end_ns = ViewTurns(frame_ns), round(seconds * NS_PER_S)
        while (press_ns := self.next_press_ns()) is not None and press_ns <= end_ns:
            for t_ns, control, value in self.presses(press_ns):
                taken_ns = math.ceil(t_ns / frame_ns) * frame_ns
                if value <= 0 or not turns.press(control, taken_ns):
                    continue
                scene, there_ns = self._scene, turns.there_ns
                if isinstance(scene, FlatScene) and turns.goal_deg == self._goal_deg:
                    self._look_around(scene, self._goal_deg, there_ns)
        self._hand.press_no_more(ARROWS)
        return turns

    # ---- KeyPresser ----

    def answer_by_keys(self, controls: Sequence[str]) -> None:
        """Answer boards with these controls of the response device from now on."""
        self._board_controls = tuple(controls)

    def choose(self, choice: int | None, t_ns: int) -> None:
        """Press the key of a board's choice, counted from 0, after some thought; None leaves the
        question out.
        """
        self._press_choice(choice, t_ns, self.takes_s(None))

    # ---- within ----

    def _meet(self, scene: Scene, t_ns: int) -> None:
        """Receive a scene; all around it gaze goes farther at a time, and takes the head along."""
        is_around = isinstance(scene, FlatScene) and scene.panorama is not None
        reach = AROUND_REACH if is_around else 1.0
        self._person["amplitude_rad"] = self.temperament.constants["amplitude_rad"] * reach
        if self._layout is None or self._layout.scene is not scene:
            self._familiar_areas = frozenset()
        super()._meet(scene, t_ns)

    def _layout_of(self, scene: Scene) -> Layout | PictureLayout | None:
        if isinstance(scene, FlatScene) and (sheets := areas_of(scene)):
            screen = scene.surface.screen if scene.panorama is not None else None
            return PictureLayout(scene, sheets, self._seat, screen)
        if scene.room is not None:
            things = seen_of_room(scene.room, self._seat)
            areas = areas_of_room(scene.room).areas
            names = [areas[thing.area].name for thing in things]
            if not scene.agents:
                return RoomLayout(scene, things, self._seat, scene.room.screen, names)
            return Layout(scene, self._seat, things, names)
        return super()._layout_of(scene)

    def _appeal_of(self, what: Layout | PictureLayout) -> npt.NDArray[np.float64]:
        """Return the appeal of each target; a room attracts less with few people than with many.

        The model's room was fitted with an audience; here no speaker is known to stand aside.
        """
        appeal = super()._appeal_of(what)
        if isinstance(what, PictureLayout):
            unknown = self._unknown_areas(what)
            is_unknown = np.zeros(len(appeal), np.bool_)
            is_unknown[: len(what.names)] = [name in unknown for name in what.names]
            return np.where(is_unknown, 0.0, appeal)
        kind = what.targets["kind"]
        people = int((kind == HEAD).sum())
        appeal[kind == ROOM] *= min(1.0, people / FITTED_PEOPLE)
        appeal[kind == SPEAKER_SIDE] = 0.0
        return appeal

    def _unknown_areas(self, what: PictureLayout) -> frozenset[str]:
        """Return the areas that a window at gaze has yet to uncover; none without one."""
        window = what.scene.gaze_window if isinstance(what.scene, FlatScene) else None
        if window is None or window.is_around:
            return frozenset()
        return hidden_areas(what, window) - self._familiar_areas

    def _uncover(self, scene: FlatScene, place: WindowPlace) -> None:
        """See what a window at gaze uncovers at a place: from then on it attracts."""
        what, window = self._layout, scene.gaze_window
        if not isinstance(what, PictureLayout) or window is None or place.t_sample_ns is None:
            return
        unknown = self._unknown_areas(what)
        if not unknown:
            return
        new = unknown & areas_in_window(what, self._targets, window, place, self._seat)
        if not new:
            return
        self._familiar_areas |= new
        self._appeal = self._appeal_of(what)
        self._targets["appeal"] = self._appeal
        if self._moving is not None:  # of those that move only what is there attracts
            self._moving.move(self._targets, self._appeal, self._moved_step * MOVES_NS)
        self._plan_number += 1

    def _look_around(self, scene: FlatScene, turned_deg: tuple[float, float], t_ns: int) -> None:
        """See where the areas of a panorama are as a screen shows it, and turn the view there: to
        what attracts, or anywhere.
        """
        screen = scene.surface.screen
        if screen is None or (self._looks_around and turned_deg == self._turned_deg):
            return
        if not self._looks_around:
            self._looks_around, self._goal_deg, self._turns = True, turned_deg, 0
        self._turned_deg = turned_deg
        layout = self._layout = PictureLayout(
            scene, areas_of(scene), self._seat, screen, turned_deg
        )
        self._appeal = self._appeal_of(layout)
        for name in ("direction", "distance_m"):
            self._targets[name] = layout.targets[name]
        self._targets["appeal"] = self._appeal
        if layout.is_moving:
            self._moving = layout
            layout.move(self._targets, self._appeal, self._moved_step * MOVES_NS)
        self._plan_number += 1
        if turned_deg == self._goal_deg:
            self._turn_on(scene, t_ns)

    def _turn_on(self, scene: FlatScene, t_ns: int) -> None:
        """Decide where to look next in a panorama that a screen shows in parts, and press what
        turns the view there.
        """
        self._turns += 1
        rng = self._rng(_TURN_STREAM, self.stretch(), self._turns)
        (around,) = (one for one in areas_of(scene) if isinstance(one, SurroundingAreas))
        all_around = PictureLayout(scene, [around], around.pose.position_m)
        targets = all_around.targets
        targets["appeal"] = self._appeal_of(all_around)
        all_around.move(targets, targets["appeal"].copy(), t_ns)
        share = targets["appeal"] / targets["appeal"].sum()
        chosen = targets["direction"][rng.choice(len(share), p=share)]
        own = rotate(quat_conjugate(around.pose.orientation_wxyz), chosen)
        yaw_deg, pitch_deg = (float(v) for v in yaw_pitch_deg_of(own))
        right_deg, up_deg = self._goal_deg
        to_right = round(((-yaw_deg - right_deg + 180.0) % 360.0 - 180.0) / STEP_DEG)
        pitch_deg = float(np.clip(pitch_deg, -MAX_PITCH_DEG, MAX_PITCH_DEG))
        upwards = round(pitch_deg / STEP_DEG) - round(up_deg / STEP_DEG)
        keys = ["right" if to_right > 0 else "left"] * abs(to_right)
        keys += ["up" if upwards > 0 else "down"] * abs(upwards)
        if not keys:  # it is before them; somebody who sees all of it turns on
            keys = ["right" if rng.random() < 0.5 else "left"]
        wait_s = float(TURN_S * np.exp(THINKING_LOG_SD * rng.standard_normal()))
        for number, key in enumerate(keys):
            self._hand.press(t_ns + round((wait_s + number * STEP_S) * NS_PER_S), key)
            right, up = ARROWS[key]
            right_deg, up_deg = right_deg + right * STEP_DEG, up_deg + up * STEP_DEG
        self._goal_deg = right_deg, up_deg

    def _pointer_stops(
        self, scene: FlatScene, seconds: float
    ) -> tuple[PictureLayout, list[tuple[float, int]]]:
        """Return the areas of a picture on a page, and when a pointer comes to which of them."""
        layout = PictureLayout(scene, areas_of(scene), np.zeros(3))
        rng = self._rng(_POINTER_STREAM, self.stretch())
        stops, t_s, last = [], STEP_S, -1
        while t_s < seconds:
            appeal = self._appeal_of(layout).copy()
            if last >= 0:
                appeal[last] = 0.0
            last = int(rng.choice(len(appeal), p=appeal / appeal.sum()))
            stops.append((t_s, last))
            t_s += float(POINTER_STOP_S * np.exp(THINKING_LOG_SD * rng.standard_normal()))
        return layout, stops

    def _finds_after_s(self, search: WhenGazeOn, limit_s: float) -> float | None:
        """Begin to look for an area in what is shown; return how long after its onset the person
        presses, as far as they foresee; None if they do not come to it.
        """
        view = self._first
        if view is None:
            return None
        scene = view.scene
        if isinstance(scene, FlatScene) and scene.head is None and areas_of(scene):  # on a page
            if scene.panorama is not None:
                raise DataError(
                    "WhenGazeOn: on a page nobody's eyes are simulated, and no pointer comes to an "
                    "area of a panorama; answer with an option or a Race there"
                )
            layout, stops = self._pointer_stops(scene, limit_s)
            place = search.place_among(layout.names)
            ends_s = [*(t_s for t_s, _ in stops[1:]), limit_s]
            for (t_s, at), end_s in zip(stops, ends_s, strict=True):
                if at == place and end_s - t_s >= search.seconds:
                    return t_s + search.seconds + search.other_s
            return None
        self._search = search
        self._search_ends_ns = self._first_ns + round(limit_s * NS_PER_S)
        press_ns = self._search_press_ns = self._foreseen_press_ns(search, self._first_ns)
        return None if press_ns is None else (press_ns - self._first_ns) / NS_PER_S

    def _foresee_press(self, search: WhenGazeOn, now_ns: int) -> None:
        """Press at another time if what is seen has changed where the person will look."""
        if self._search_press_ns is not None:
            if self._search_press_ns - round(search.other_s * NS_PER_S) <= now_ns:
                self._search = None  # they have looked for long enough: what comes later is late
                return
        if self._search_plan == self._plan_number:
            return
        self._hand.press_no_more([search.option])
        begin_ns = now_ns - round(search.seconds * NS_PER_S)
        press_ns = self._search_press_ns = self._foreseen_press_ns(search, begin_ns)
        if press_ns is not None:
            self._hand.press(press_ns, search.option)

    def _foreseen_press_ns(self, search: WhenGazeOn, from_ns: int) -> int | None:
        """Return when the person has looked at an area for long enough and presses."""
        what = self._layout
        place = search.place_among(() if what is None else what.names)
        self._search_plan = self._plan_number
        t_ns = np.arange(max(from_ns, self._first_ns), self._search_ends_ns, LOOK_STEP_NS)
        if not len(t_ns):
            return None
        is_here = np.zeros(len(t_ns), np.bool_)
        for run, eyes, positions_m, orientations, targets in self._senses_ahead(t_ns):
            area = targets[place]
            at_m = self._seat + area["direction"] * area["distance_m"]
            looks = rotate(orientations, unit(eyes[:, :3] + eyes[:, 3:6]))
            cosine = np.einsum("ij,ij->i", looks, unit(at_m - positions_m))
            within_rad = area["radius_rad"] + np.radians(DEFAULT_PAD_DEG)
            is_there = area["appeal"] > 0 or self._appeal[place] == 0  # else it is gone for a time
            is_here[run] = is_there & (cosine > np.cos(within_rad))
        return search.press_ns(t_ns, is_here)

    def _forget(self) -> None:
        self._first: SceneFrame | None = None
        self._last: SceneFrame | None = None
        self._first_ns = self._last_ns = 0
        self._contact_ns: npt.NDArray[np.float64] = np.zeros(0)
        self._contact: npt.NDArray[np.bool_] = np.zeros(0, np.bool_)
        self._panel_text = ""
        self._hand = PointingHand(np.array(HAND_REST))
        self._vibrating_roles: list[str] = []
        self._films = {}
        self._live: Live | None = None
        self._caption = ""
        self._figures: LiveScene | None = None
        self._moulding = None
        self._ears = Ears()
        self._listens_for = ()
        self._looks_around = False
        self._turned_deg = self._goal_deg = 0.0, 0.0
        self._turns = 0
        self._familiar_areas = frozenset()
        self._search = None

    def _see_figure(self, view: MouldingFrame, t_ns: int) -> None:
        """At first sight of a figure to mould: look at it, and press what moulds it."""
        if view.moulding is self._moulding or view.moulding is None or view.people is None:
            return
        self._hand.press_no_more()
        moulding = self._moulding = view.moulding
        head_m = view.people.root_m[0] + np.array([0.0, 0.3, 0.0])
        if moulding.scene is not None:
            self.watch_figures(moulding.scene, moulding.caption)
        else:
            self.mould(moulding.live, moulding.caption)
        self.look_at(head_m.tolist(), t_ns)
        pace = self.pace
        start = np.array([slider.start for slider in moulding.sliders])
        step = np.array([press_step(slider) for slider in moulding.sliders])
        moves, ends = self._movements(moulding, start, step)
        board, n = view.panels[0], len(view.panels[0].tracks)
        if view.by_keys:
            pressed, row = presses(moves, start, step, pace)
            if ends:
                ready_s = (pressed[-1][0] if pressed else moulding.earliest_s) + LOOK_S * pace
                ending = ["down"] * (n - row) + ["trigger"]
                pressed += [(ready_s + KEY_S * pace * k, key) for k, key in enumerate(ending)]
            for t_s, control in pressed:
                self._hand.press(t_ns + round(t_s * NS_PER_S), control)
            return
        begin_s = (t_ns - self._origin_ns) / NS_PER_S
        later = made_in_turn(moves, lambda _: POINT_S + 2 * PRESS_S)
        goals = [(move.t_s, self._on_track(board, moulding, move)) for move in later]
        if ends:
            ready_s = (goals[-1][0] if goals else moulding.earliest_s) + LOOK_S * pace + POINT_S
            goals.append((ready_s, choice_centre_m(board, 0)))
        for t_s, goal_m in goals:
            self._hand.point(begin_s + t_s - POINT_S - PRESS_S, goal_m - self._seat)
            self._hand.press(t_ns + round(t_s * NS_PER_S), "trigger")

    def _on_track(self, board: Panel, moulding: Moulding, move: Movement) -> Vector:
        slider = moulding.sliders[move.slider]
        begin, end, down = track_01(board, move.slider)
        share = (move.value - slider.low) / (slider.high - slider.low)
        return place_m(board, begin + share * (end - begin), down)

    def _movements(
        self, moulding: Moulding, start: Vector, step: Vector
    ) -> tuple[Sequence[Movement], bool]:
        """Return movements of sliders, and whether the person then presses the button."""
        live, until, sliders = moulding.live, moulding.until, moulding.sliders
        if until is None or not live.beside:
            moves, t_s = [], 0.0
            for i, slider in enumerate(sliders):
                t_s += self.takes_s(slider)
                reply = self._reply_to(slider)
                goal = start[i] if reply is None else float(reply)
                goal = float(np.clip(goal, slider.low, slider.high))
                count = round((goal - start[i]) / step[i])
                value = float(np.clip(start[i] + count * step[i], slider.low, slider.high))
                moves += [Movement(t_s, i, value)] if count else []
            return moves, True
        joints = compared_joints(live.examples.skeleton)
        likeness = Likeness(live.examples, until.shares(live.examples), until.poses, joints)
        task = Task(
            np.array([slider.low for slider in sliders]),
            np.array([slider.high for slider in sliders]),
            step,
            start,
            lambda values: likeness.rough_m(live.shares(values)),
            lambda values: likeness.exact_m(live.shares(values)),
        )
        outcome = self.mould_to(
            task,
            within_m=CLOSE_01 * until.within_m,
            limit_s=moulding.limit_s,
            is_blind=moulding.is_blind,
        )
        return outcome.moves, moulding.is_blind

    def _take_in(self, view: SceneFrame, t_ns: int) -> None:
        if self._last is None or view.scene is not self._last.scene:
            self._first, self._first_ns = view, t_ns
            # Of who has no gaze nothing is known, however long they are there.
            self._contact_ns = np.array([0.0 if a.has_gaze else np.nan for a in view.scene.agents])
            self._contact = np.zeros(len(view.scene.agents), np.bool_)
            if self._search is not None:
                self._hand.press_no_more([self._search.option])
                self._search = None
            self._press_when_noticed(view, t_ns)
        else:
            self._contact_ns[self._contact] += t_ns - self._last_ns
        if self._last is None or view.gaze_direction is not self._last.gaze_direction:
            self._contact = self._meets_me(view, t_ns)
        self._last, self._last_ns = view, t_ns

    def _meets_me(self, view: SceneFrame, t_ns: int) -> npt.NDArray[np.bool_]:
        agents = agents_at(view.scene, t_ns)
        if not agents:
            return np.zeros(0, np.bool_)
        to_me = unit(self._seat - np.array([a.eye_centre_m for a in agents]))
        looks_at_me = np.einsum("ij,ij->i", to_me, view.gaze_direction) > np.cos(
            np.radians(CONTACT_DEG)
        )
        return np.asarray(looks_at_me & (view.eye_openness_01 > 0.5), np.bool_)

    def _impressions(self) -> Seen:
        elapsed_ns = max(self._last_ns - self._first_ns, 1)
        return Seen(
            self._first,
            self._last,
            elapsed_ns / NS_PER_S,
            self._contact_ns / elapsed_ns,
            self.notices_contact,
            self._leaning,
            tuple(self._vibrating_roles),
            (self.temperament.vr_experience - 1) / 4,
            self._films,
            self._live,
            self._caption,
            self._figures,
            self._visit,
            self._ears.sounds,
        )

    def _reply_to(self, response: Response) -> str | None:
        return self._timed_reply_to(response)[0]

    def _timed_reply_to(self, response: Response) -> tuple[str | None, float | None]:
        """Return an answer, and how many seconds it takes if the study's model says so."""
        rng = self._rng(_MIND_STREAM, self.stretch(), zlib.crc32(response.name.encode()))
        reply = self._answer_of(self._impressions(), response, rng)
        takes_s: float | None = None
        if isinstance(reply, Race):
            reply, takes_s = reply.run(rng)
        if isinstance(reply, WhenNear) and isinstance(response, Keys):
            takes_s = None
            if self._first is not None:
                takes_s = reply.seconds(self._first, self._first_ns, self._seat, response.limit_s)
            reply = None if takes_s is None else reply.option
        if isinstance(reply, WhenGazeOn) and isinstance(response, Keys):
            takes_s = self._finds_after_s(reply, response.limit_s)
            reply = None if takes_s is None else reply.option
        if reply is None:
            return None, None
        options = tuple(map(str, response.options))
        if options and str(reply) not in options:
            raise DataError(
                f"the simulated person answered {reply!r} to {response.name}; its options are "
                f"{', '.join(options)}"
            )
        return str(reply), takes_s

    def takes_s(self, response: Response | None) -> float:
        """Return how long this person takes to answer."""
        name = "" if response is None else response.name
        rng = self._rng(_PACE_STREAM, self.stretch(), zlib.crc32(name.encode()))
        return float(THINKING_S * np.exp(THINKING_LOG_SD * rng.standard_normal()))

    def _decide(self, panel: Panel, t_ns: int) -> None:
        response = self._responses.get(panel.text)
        if response is None:
            return
        reply = self._reply_to(response)
        if reply is None:
            return
        takes_s = max(self.takes_s(response), POINT_S + 0.15)
        choice = list(map(str, response.options)).index(reply)
        middle = choice_centre_m(panel, choice)
        if self._board_controls:
            self._press_choice(choice, t_ns, takes_s)
            self.look_at(middle.tolist(), t_ns)
            return
        since_s = (t_ns - self._origin_ns) / NS_PER_S
        self._hand.point(since_s + takes_s - POINT_S, middle - self._seat)
        self._hand.press(t_ns + round((takes_s + PRESS_S) * NS_PER_S), "trigger")
        self.look_at(middle.tolist(), t_ns)

    def _press_choice(self, choice: int | None, t_ns: int, takes_s: float) -> None:
        """Press what takes a choice: its digit or, without digits, arrows and then a confirmation.

        Somebody who has neither presses nothing, and the operator answers for them.
        """
        for number, control in enumerate(keys_of_choice(choice, self._board_controls)):
            self._hand.press(t_ns + round((takes_s + number * STEP_S) * NS_PER_S), control)

    def _press_when_noticed(self, view: SceneFrame, t_ns: int) -> None:
        """Press if the study asks for keys, which a person only knows from the instruction.

        Flat stimuli are answered where the instruction says so: a fixation cross is not.
        """
        is_flat = isinstance(view.scene, FlatScene)
        answered_by = view.scene.answered_by if isinstance(view.scene, FlatScene) else ""
        if isinstance(view.scene, FlatScene) and view.scene.sounds:
            self._ears.listen()
            self._listens_for = tuple(
                response
                for response in dict.fromkeys(self._responses.values())
                if isinstance(response, Keys) and response.name == answered_by
            )
            return
        self._listens_for = ()
        for response in dict.fromkeys(self._responses.values()):
            if isinstance(response, Keys) and (not is_flat or response.name == answered_by):
                reply, takes_s = self.press(response)
                if reply is not None:
                    self._hand.press(t_ns + round(takes_s * NS_PER_S), reply)
            elif isinstance(response, Pointing) and self._last is not None:
                self._hand.press(t_ns + round(self.takes_s(response) * NS_PER_S), "trigger")


def neutral_answer(seen: Seen, response: Response, rng: np.random.Generator) -> Any:
    """Answer as a person to whom the stimuli make no difference."""
    if isinstance(response, Rating):
        middle = (response.low + response.high) / 2
        spread = (response.high - response.low) / 6
        rating = middle + spread * (0.7 * seen.leaning + rng.standard_normal())
        return int(np.clip(round(rating), response.low, response.high))
    if isinstance(response, Number):
        low, high = max(response.low, 0.0), min(response.high, max(response.low, 0.0) + 100.0)
        return f"{rng.uniform(low, high):.1f}"
    if isinstance(response, FreeText):
        return None if rng.random() < 0.5 else "I just looked around."
    if isinstance(response, Choice | SideBySide | Keys):
        return response.options[int(rng.integers(len(response.options)))]
    return None


def plain_answer(
    age: int, gender: str, question_id: str, options: Sequence[str], rng: np.random.Generator
) -> str | None:
    """Answer age and gender, and other questions with any option; None leaves a question out."""
    if question_id == "age":
        return str(age)
    if question_id == "gender":
        return gender if gender in options else None
    return options[int(rng.integers(len(options)))] if options else None
