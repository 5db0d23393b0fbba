"""The steps of a study's trial: dark, show, ask, wait, key, play, vibrate, mark, walk.

A trial is a generator over a `TrialScript`: it yields what the script's methods return and gets
back the result (an `Answer`, a `ShownScene`). The parts of a step (frames, marks, a board that
follows a ray) happen inside, so a trial reads like its protocol. Steps of
`visavis.protocol.plan.steps` may be yielded too, where a study needs the frame itself.
"""

import difflib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final, Literal, TypeAlias, overload

import numpy as np

from visavis.devices.contracts import VibrationPattern
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Pose, Vector
from visavis.lab.kinds import takes_kinds
from visavis.lab.yaml_lines import names_or_none
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import (
    EndEarly,
    FrameView,
    Mark,
    Play,
    Repeat,
    Scalar,
    Show,
    Step,
)
from visavis.stimuli.area_paths import with_areas_there
from visavis.stimuli.flat import (
    MAX_SEED,
    Colour,
    Dots,
    Flat,
    Text,
    Video,
    films_among,
)
from visavis.stimuli.gaze_window import GAZE_WINDOW
from visavis.stimuli.own_room import Room
from visavis.stimuli.panels import SIZE_M, PanelFrame, Surface, board_before
from visavis.stimuli.picture import Panel
from visavis.stimuli.scene import SceneFrame
from visavis.study.actions import Action, Performing
from visavis.study.asking import (
    Answer,
    ask_at_terminal,
    asked_on_board,
    await_pointing,
    await_press,
    direction_columns,
)
from visavis.study.background import BackgroundExecutor
from visavis.study.films import LiveFilm, Stimulus, Viewing, scene_of, seconds_of, voiced_film
from visavis.study.frames import dark_frame, dark_view
from visavis.study.gaze_on import GazeOn
from visavis.study.heard_trial import HeardTrial
from visavis.study.lit_trial import Until
from visavis.study.live import (
    RENDERER,
    Live,
    LiveScene,
    Moulded,
    Moulding,
    Near,
    Slider,
    SliderMove,
)
from visavis.study.moulding import BoardWords, moulded
from visavis.study.quest_plus import QuestPlus, QuestPlusTrial
from visavis.study.responses import FreeText, Keys, Pointing, Rating, Response, labels_of
from visavis.study.scenes import FLAT, ROOM, PassingScene, Scene, StagedScene
from visavis.study.showing import (
    Reveal,
    Showing,
    Stimuli,
    awaited_keys,
    duration,
    parts_of,
    shown_seconds,
    window_of,
)
from visavis.study.staircase import Staircase, StaircaseTrial
from visavis.study.trial_settings import Settings, is_on_board

OWN_STREAM: Final = 200
DOTS_STREAM: Final = 0xD075

LEAVE_S: Final = 30.0
"""How long live figures stay before a monitor or in a headset if nobody presses their button."""


class UnknownNameError(DesignError, AttributeError):
    """A trial has no factor, parameter or step of this name."""


@dataclass(frozen=True)
class _Board:
    """The place of a question: before the scene or in the dark, ahead or at a place."""

    over_scene: bool = False
    at: Pose | None = None
    size_m: tuple[float, float] | None = None


class TrialScript(HeardTrial):
    """One trial as its study writes it: factors are attributes, steps are methods.

    `row` collects the trial's columns; a study may add its own. What a trial function returns is
    added to it at the end. `is_read` is true while the trial is only run through in advance; slow
    work may then be left out.
    """

    def __init__(self, trial: Trial, settings: Settings) -> None:
        super().__init__(trial, settings)
        self.is_read = False
        self.staircases: dict[str, Staircase | QuestPlus] = {}
        self.wish: Repeat | EndEarly | None = None
        self._dots_count = 0

    def __getattr__(self, name: str) -> Any:
        """Return a factor's level in this trial, or a parameter of the study."""
        if name.startswith("_") or name in ("trial", "settings"):
            raise AttributeError(name)
        if name in self.trial.factors:
            return self.trial.factors[name]
        if name in self.settings.parameters:
            return self.settings.parameters[name]
        own = (*self.trial.factors, *self.settings.parameters)
        steps = tuple(n for n in dir(TrialScript) if not n.startswith("_"))
        near = difflib.get_close_matches(name, (*own, *steps), n=1)
        raise UnknownNameError(
            f"this trial has no factor, parameter or step {name!r}"
            + (f"; did you mean {near[0]}?" if near else f"; it has {names_or_none(own)}")
        )

    @property
    def is_practice(self) -> bool:
        """Whether the trial is practice."""
        return self.trial.is_practice

    @property
    def now_ns(self) -> int:
        """Session time of the current frame; 0 before the first."""
        return 0 if self.view is None else self.view.t_ns

    @property
    def session_memory(self) -> dict[str, Any]:
        """Data left by earlier trials of this session; empty again in a resumed session, so that
        nothing may rest on it that rows do not hold (`t.staircase` rests on rows).
        """
        return self.settings.memory

    @property
    def beside(self) -> BackgroundExecutor:
        """Executor that runs functions without delaying a frame: `beside.submit(function, …)`."""
        return self.settings.beside

    def rng(self, stream: int = 0) -> np.random.Generator:
        """Return the random generator of this trial: the same when the trial is performed again."""
        return self.trial.rng(OWN_STREAM + stream)

    def text(self, name: str, **values: Any) -> str:
        """Return one of the study's texts with its placeholders filled."""
        return self.settings.texts.get(name, {**self.settings.values, **values})

    @overload
    def staircase(self, staircase: Staircase, of: object = "") -> StaircaseTrial: ...

    @overload
    def staircase(self, staircase: QuestPlus, of: object = "") -> QuestPlusTrial: ...

    def staircase(
        self, staircase: Staircase | QuestPlus, of: object = ""
    ) -> StaircaseTrial | QuestPlusTrial:
        """Return a staircase, or QUEST+, in this trial: its `level`, and `take(is_right)` for the
        answer.

        Several of one rule run beside each other, each `of` something, such as a level of a factor.
        Answers of practice move only practice. Columns: see `StaircaseTrial`, `QuestPlusTrial`.
        """
        self.staircases[staircase.name] = staircase
        rows = [r for r in self.settings.rows if bool(r["is_practice"]) == self.is_practice]
        if isinstance(staircase, QuestPlus):
            return QuestPlusTrial(staircase, str(of), rows, self.row)
        return StaircaseTrial(staircase, str(of), rows, self.row)

    @takes_kinds()
    def remember(self, row: Mapping[str, Any]) -> None:
        """Let later trials of the session know the row of this one, unless it comes again."""
        if isinstance(self.wish, Repeat):
            self.settings.note_repeat(self.trial.trial_id)
        else:
            self.settings.rows.append({**row, "is_practice": self.is_practice})

    # ---- steps ----

    @takes_kinds()
    def dark(self, seconds: float) -> Action:
        """Show nothing for some seconds."""
        return Action("dark", lambda: self._dark(seconds), duration("dark", seconds))

    @takes_kinds(what=Any)
    def show(
        self,
        what: Scene | Room | Stimuli,
        seconds: float | None = None,
        *,
        frames: int | None = None,
        until: Until | Keys | None = None,
        limit_s: float | None = None,
        background: Colour = "black",
        name: str | None = None,
        reveal: Reveal | None = None,
        window_deg: float = 4.0,
        edge_deg: float = 0.0,
        blur_deg: float | None = None,
    ) -> Action:
        """Show a scene, a `Room`, or flat stimuli (`Text`, `Image`, `Shape`, `Grating`, `Dots`,
        `Video`; the last in front; before a `Panorama`, if there is one), for some seconds or
        frames, or until `until` is true for a frame (`gaze_on` says of gaze when) or a key of it is
        pressed. `Tone`
        and `Sound` are heard with them or alone, all from the beginning, and to their end or the
        trial's; alone they need no `seconds`, and neither does a `Video` or the `Panorama` of a
        film, which then lasts as long as it does.
        Stimuli in a mapping have names, which make areas of interest of them. With
        `reveal="gaze"` flat stimuli are seen through a window `window_deg` wide that follows gaze,
        with "around gaze" everywhere but there, on a page with "pointer" through one that follows
        the pointer. The rest is blurred by `blur_deg`, 0 covers it with the background (unless
        given, an eighth of the window; around gaze 0); over `edge_deg` the one becomes the other.

        Columns: `NAME_on_ns` and `NAME_off_ns` (a second scene of a trial: `NAME2_on_ns`),
        `NAME_frames`, and `NAME_ROLE` for the agent that plays a role; `NAME_sound_on_ns` for a
        sound (a second: `NAME_sound2_on_ns`); `NAME_window_delay_ms` (median),
        `NAME_window_delay_p95_ms` and `NAME_window_lost_frames` of a window after gaze. NAME is
        "scene", and "stimulus" for flat stimuli and sounds; what is heard alone is timed from its
        own onset. The step returns a `ShownScene`; with `Keys` the `Answer`, timed from the first
        lit frame and missing after `limit_s`, with the columns of `t.key`.
        What is shown stays until the next step shows something else; with both `seconds` and
        `Keys` it goes after the seconds, and the press is waited for in the dark.

        Raises:
            DesignError: there is nothing to show, or nothing says how long.
        """
        keys = awaited_keys(until, limit_s)
        parts = parts_of(what)
        sounds, names, panorama = parts.sounds, parts.names, parts.panorama
        flats = tuple(map(self._with_seed, parts.flats))
        folder, losses = self.settings.folder, self.settings.files_gone
        if losses is not None:
            flats = tuple(with_areas_there(flat, folder, losses) for flat in flats)
            panorama = panorama and with_areas_there(panorama, folder, losses)
        is_flat = not parts.is_empty
        window = window_of(reveal, window_deg, edge_deg, blur_deg)
        if window is not None and not flats and panorama is None:
            raise DesignError("t.show: reveal is for pictures, texts and the like; leave it out")
        follows_gaze = window is not None and reveal != "pointer"
        if is_flat:
            own = films_among((panorama, *flats))
            sounds += tuple(of for film in own for of in self.settings.film_sounds(film))
            options: dict[str, Any] = {"background": background}
            options["answered_by"] = keys.name if keys else ""
            options |= {"names": names} if names else {}
            options |= {"sounds": sounds} if sounds else {}
            options |= {} if panorama is None else {"panorama": panorama}
            options |= {GAZE_WINDOW: window} if follows_gaze else {}
            scene = Scene(FLAT, items=flats, **options)
            if (sounds or own) and seconds is None and frames is None and until is None:
                lengths_s = map(self.settings.film_seconds, own)
                seconds = max([*lengths_s, *map(self.settings.seconds_of, sounds)])
        elif isinstance(what, Scene | Room):
            scene = what if isinstance(what, Scene) else Scene(ROOM, room=what)
        else:
            raise DesignError(
                "t.show shows a Scene, a Room, Text, Image, Shape, Grating, Dots, Video, Panorama, "
                f"Tone or Sound, or a list of the latter; not {what!r}"
            )
        name = name or ("stimulus" if is_flat else "scene")
        seconds = shown_seconds(seconds, frames, keys, until)
        wide_deg = 0.0 if window is None or follows_gaze else window.window_deg
        moves = panorama is not None or any(isinstance(flat, Dots | Video) for flat in flats)
        if wide_deg and moves:
            raise DesignError(
                't.show: reveal="pointer" uncovers what stands still; dots, films and the view '
                "onto a Panorama move"
            )
        showing = Showing(scene, seconds, frames, name, is_flat, wide_deg, sounds)
        if keys is not None:
            perform = partial(self._answer_shown, showing, keys)
        else:
            stop = None if isinstance(until, Keys) else until
            perform = partial(self._show_exactly if is_flat else self._show, showing, stop)
        lasts_s = min(seconds, 0.0 if keys is None else keys.limit_s) if keys else seconds
        is_of_page = is_flat and (until is None or keys is not None) and not follows_gaze
        of_page = showing if is_of_page else None
        return Action(
            "show",
            perform,
            lasts_s,
            response=keys,
            scene=scene,
            column=name,
            showing=of_page,
            gaze_on=until if isinstance(until, GazeOn) else None,
            sounds=sounds,
        )

    def _with_seed(self, flat: Flat) -> Flat:
        """Return a stimulus; dots without a seed get one of the trial."""
        if not isinstance(flat, Dots):
            return flat
        self._dots_count += 1
        if flat.seed is not None:
            return flat
        rng = self.trial.rng(DOTS_STREAM + self._dots_count)
        return replace(flat, seed=int(rng.integers(MAX_SEED)))

    @takes_kinds()
    def ask(
        self,
        response: Response | Text,
        *,
        over_scene: bool = False,
        at: Pose | None = None,
        size_m: tuple[float, float] | None = None,
    ) -> Action:
        """Ask a question; the answer's columns join the row, and the step returns the `Answer`.

        The board stands in the dark, or before the scene with `over_scene`; straight ahead of the
        participant and as large as what it is read on asks for, or `at` a place of the tracked
        room. Free text and numbers are asked at the terminal.
        """
        if isinstance(response, Text):  # as free text was declared before texts were shown
            response = FreeText(response.text)
        place = _Board(over_scene, at, size_m)
        return Action("ask", lambda: self._ask(response, place), response=response)

    @takes_kinds()
    def watch(
        self,
        stimulus: Stimulus,
        *responses: Response,
        caption: str = "",
        min_rounds: int = 1,
        replay: bool = True,
    ) -> Action:
        """Show a `Film`, a `Pair`, live figures (`LiveScene`) or a `LiveFilm` round after round,
        with questions below; without `replay` one round of a film, after which a page stays at the
        last picture.

        Answers count after `min_rounds` whole rounds; times of answers run from the first picture
        that was presented, of a `LiveFilm` from when its questions opened. Columns: those of the
        responses, and `film_on_ns`, `film_off_ns`, `film_frames`; of what is drawn live those of
        `LIVE_COLUMNS` (`live_on_ns` and so on). The step returns the `Answer` to each response by
        name. Before a headset or a monitor the scene
        itself is shown for so many rounds (one at least), figures on until a button is pressed or
        30 s are over; then questions follow on boards. The `caption` of films is read on pages
        alone. A film with a `Voice` is heard, once before a headset or a monitor, and adds
        `film_sound_on_ns`.
        """
        viewing = Viewing(stimulus, responses, caption, min_rounds, replay)
        seconds = max(1, min_rounds) * seconds_of(stimulus)
        shown = None if isinstance(stimulus, LiveScene | LiveFilm) else scene_of(stimulus)
        return Action(
            "watch",
            lambda: self._watch(viewing),
            seconds,
            scene=shown,
            column="film",
            viewing=viewing,
        )

    @takes_kinds()
    def mould(
        self,
        live: Live,
        sliders: Sequence[Slider],
        *,
        until: Near | None = None,
        limit_s: float = 300.0,
        caption: str = "",
        is_blind: bool = False,
    ) -> Action:
        """Let a participant mould a live figure by sliders, and turn it.

        On a page sliders are dragged; before a monitor or in a headset they stand on a board, and
        keys or a controller's ray move them (`visavis.study.moulding`). It ends by a button; with
        `until`, when the figure is near that target instead; after `limit_s` in any case. With
        `is_blind` participants see the target alone and guess: a button ends it, and how near they
        came is recorded. Columns: those of every slider (its last value, and when it was moved
        last), and `mould_on_ns`, `mould_ended_by` and so on (`MOULD_COLUMNS`). The step returns a
        `Moulded` with every movement of the sliders.
        """
        moulding = Moulding(live, tuple(sliders), until, limit_s, caption, is_blind)
        return Action("mould", lambda: self._mould(moulding), moulding=moulding)

    @takes_kinds()
    def key(self, response: Keys) -> Action:
        """Wait for a press, timed from the last onset of a scene or sound.

        The scene and all sounds go on.
        """
        return Action("key", lambda: self._key(response), 0.0, response=response)

    @takes_kinds()
    def wait(self, seconds: float) -> Action:
        """Leave everything as it is for some seconds."""
        return Action("wait", lambda: self._wait(seconds), duration("wait", seconds))

    @takes_kinds()
    def vibrate(
        self,
        role: str,
        seconds: float = 0.2,
        *,
        motors: tuple[int, ...] = (0,),
        amplitude_01: float = 1.0,
        pattern: VibrationPattern | None = None,
    ) -> Action:
        """Let an armband vibrate from now on; it ends by itself, the trial goes on at once."""
        duration("vibrate", seconds)
        vibration = pattern or VibrationPattern("steady", round(seconds * 1000))
        return Action(
            "vibrate", lambda: self._vibrate(role, vibration, motors, amplitude_01), role=role
        )

    @takes_kinds(payload=Any)
    def mark(self, name: str, **payload: Scalar | None) -> Action:
        """Write an event into the recording at the current frame's time."""
        return Action("mark", lambda: self._mark(name, payload))

    @takes_kinds()
    def repeat(self, reason: str, *, at_most: int = 3) -> Action:
        """Have this trial performed again at the end of its block, `at_most` so many times.

        The trial goes on to its end. Its row keeps the reason, with the status "repeated", and does
        not count; staircases stay where they were. The step returns whether the trial comes again:
        once it came `at_most` times it does not, and counts as it is.
        """
        return Action("repeat", lambda: self._repeat(reason, at_most))

    @takes_kinds()
    def end(self, reason: str, *, of: Literal["block", "session"] = "session") -> Action:
        """End the session, or its block, after this trial, which counts.

        The trials that are left get rows with the status "skipped" and the reason. Questionnaires
        at the session's end are asked.
        """
        return Action("end", lambda: self._wish_for(EndEarly(reason, of)))

    @takes_kinds()
    def walk_to(
        self, x_m: float, z_m: float, *, within_m: float = 0.35, limit_s: float = 60.0
    ) -> Action:
        """Wait until the participant's head is above a point of the floor.

        Columns: `walk_ms` and whether it was reached, `walk_reached`.
        """
        duration("walk_to", limit_s)
        place = (x_m, z_m)
        return Action("walk_to", lambda: self._walk_to(place, within_m, limit_s))

    def showing(self, staged_scene: StagedScene, onset_ns: int) -> None:
        """Report that the study itself shows a scene frame by frame, lit since a session time.

        Boards then appear before it, and it stays during waiting.
        """
        self._staged_scene, self._onset_ns, self._lit_frame = staged_scene, onset_ns, None

    # ---- how they are performed ----

    def _answer_shown(self, showing: Showing, keys: Keys) -> Performing:
        answer = yield from self._show_until_key(showing, keys)
        return (yield from self._record_answer(keys, answer))

    def _watch(self, viewing: Viewing) -> Performing:
        stimulus = viewing.stimulus
        seconds = max(1, viewing.min_rounds) * seconds_of(stimulus)
        if isinstance(stimulus, LiveScene):
            yield from self._watch_figures(stimulus, viewing.caption, seconds)
        elif isinstance(stimulus, LiveFilm):
            raise DesignError("a LiveFilm is drawn by pages; show its scene with t.show")
        else:
            showing = Showing(scene_of(stimulus), seconds, None, "film")
            yield from self._show(showing, None, voiced_film(stimulus))
        answers = {}
        for response in viewing.responses:
            answers[response.name] = yield from self._ask(response, _Board())
        return answers

    def _watch_figures(self, scene: LiveScene, caption: str, seconds: float) -> Performing:
        """Show live figures with a board that turns them for some seconds, and on to its button."""
        limit_s = seconds + LEAVE_S
        moulding = Moulding(scene.live, (), None, limit_s, caption, scene=scene, earliest_s=seconds)
        name = self.next_prefix("live")
        end = yield from self._figures(moulding, name)
        on_ns, off_ns = end.on_ns, end.view.t_ns
        columns: dict[str, Scalar | None] = {
            "on_ns": on_ns,
            "off_ns": off_ns,
            "turns": len(end.changes),
            "rounds": int((off_ns - on_ns) / NS_PER_S / scene.cycle_s),
            "frames": end.frames,
            "frames_dropped": None,  # the display's own stream has them
            "wait_ms": None,
            "hidden_ms": None,
            RENDERER: None,
        }
        self.row.setdefault("t_start_ns", on_ns)
        self.row |= {f"{name}_{column}": value for column, value in columns.items()}
        yield dark_view(off_ns)
        self.row["t_end_ns"] = off_ns
        self.view = end.view

    def _figures(self, moulding: Moulding, name: str) -> Performing:
        """Show live figures with their board; return the `MouldingEnd`."""
        before = yield from self._now()
        self._staged_scene = None
        names = tuple(self.words_of(slider)[0] for slider in moulding.sliders)
        find = self.settings.texts.get
        rest = (find(word) for word in ("board.turn", "page.next", "board.keys", "board.ray"))
        words = BoardWords(moulding.caption, names, *rest)
        about = {"trial_id": self.trial.trial_id, "figure": name}
        return (yield from moulded(moulding, words, about, before))

    def _mould(self, moulding: Moulding) -> Performing:
        name = self.next_prefix("mould")
        end = yield from self._figures(moulding, name)
        on_ns, off_ns = end.on_ns, end.view.t_ns
        turns = sum(change.slider is None for change in end.changes)
        columns: dict[str, Scalar | None] = {
            "on_ns": on_ns,
            "off_ns": off_ns,
            "ended_by": end.ended_by,
            "moves": len(end.changes) - turns,
            "turns": turns,
            "frames": end.frames,
            "frames_dropped": None,  # the display's own stream has them
            "slider_frames": 1 if len(end.changes) > turns else 0,
            "wait_ms": None,
            "hidden_ms": None,
            "distance_m": end.distance_m,
            RENDERER: None,
        }
        self.row.setdefault("t_start_ns", on_ns)
        self.row |= {f"{name}_{column}": value for column, value in columns.items()}
        yield dark_view(off_ns)
        for i, slider in enumerate(moulding.sliders):
            last = next((c for c in reversed(end.changes) if c.slider == i), None)
            by, t_ns = (end.by, off_ns) if last is None else (last.by, last.t_ns)
            option = f"{end.values[i]:.10g}"
            yield from self._record_answer(slider, Answer(option, by, on_ns, t_ns, end.view))
        self.row["t_end_ns"] = off_ns
        moves = tuple(
            SliderMove(moulding.sliders[c.slider].name, c.value, c.t_ns)
            for c in end.changes
            if c.slider is not None
        )
        values = {s.name: value for s, value in zip(moulding.sliders, end.values, strict=True)}
        seconds = (off_ns - on_ns) / NS_PER_S
        return Moulded(values, moves, end.ended_by, seconds, end.distance_m)

    def _ask(self, response: Response, board: _Board) -> Performing:
        view = yield from self._now()
        prompt, labels = self.words_of(response)
        if isinstance(response, Pointing):
            answer = yield from await_pointing(response.limit_s, view, self._scene_update)
        elif not is_on_board(response, self.settings):
            yield from self._clear(board.over_scene, view)
            answer = yield from ask_at_terminal(
                response.name, prompt, tuple(response.options), labels, view
            )
        else:
            answer = yield from asked_on_board(
                self._panel(response, board, view),
                tuple(response.options),
                response.name,
                self.settings.ways,
                view,
                self._board_shown(board.over_scene),
            )
        answer = yield from self._record_answer(response, answer)
        if not board.over_scene and not isinstance(response, Pointing):
            yield dark_view(answer.view.t_ns)
            self._staged_scene = None
        return answer

    def _key(self, response: Keys) -> Performing:
        view = yield from self._now()
        from_ns = self._sound_on_ns or self._onset_ns or view.t_ns
        controls = tuple(response.options)
        answer = yield from await_press(
            controls, response.limit_s, view, from_ns, self._scene_update
        )
        return (yield from self._record_answer(response, answer))

    def _record_answer(self, response: Response, answer: Answer) -> Performing:
        self.view = answer.view
        yield from self._tell_turns()
        if not isinstance(response, Keys):  # a board has taken the place of what was lit
            self.end_light(answer.asked_ns)
        answer = self.take(response, answer)
        name, option = response.name, answer.option
        if isinstance(response, Pointing):
            self.row |= self._pointed_at(name, answer)
        if isinstance(response, Keys) and response.distance_to is not None:
            self.row[f"{name}_distance_m"] = self._distance_m(response.distance_to, answer)
        yield Mark(
            "answered",
            {
                "trial_id": self.trial.trial_id,
                "question": name,
                "answer": option,
                "by": answer.by,
                "asked_ns": answer.asked_ns,
                "answered_ns": answer.answered_ns,
            },
        )
        return answer

    def take(self, response: Response, answer: Answer) -> Answer:
        """Put an answer's columns into the row; return the answer, which then knows its value."""
        name, option = response.name, answer.option
        value = None if option is None else response.value(option)
        took_ms = None if option is None else answer.ms
        self.row |= {name: value, f"{name}_by": answer.by, f"{name}_ms": took_ms}
        more = response.more(option)
        self.row |= more
        self.row["t_end_ns"] = answer.answered_ns
        is_right = more.get(f"{name}_is_right")
        return replace(answer, is_right=None if is_right is None else bool(is_right))

    def _pointed_at(self, name: str, answer: Answer) -> dict[str, Scalar | None]:
        agents = self._agents_at(answer.answered_ns)
        heads: Vector = np.array([a.head_centre_m for a in agents]).reshape(-1, 3)
        return direction_columns(name, answer.pose, heads, tuple(a.place for a in agents))

    def words_of(self, response: Response) -> tuple[str, tuple[str, ...]]:
        """Return the text of a question and its options, in the study's language."""
        texts, name = self.settings.texts, response.name
        values = {**self.settings.values, "name": name.replace("_", " ")}
        standard = "question"
        if isinstance(response, Rating):
            values |= {"low": response.low, "high": response.high}
            standard = "rating"
        prompt = texts.find(f"questions.{name}", standard, values=values) or name
        labels = tuple(
            texts.find(f"choices.{name}.{label}", values=values) or label
            for label in labels_of(response)
        )
        return prompt, labels

    def _panel(self, response: Response, board: _Board, view: FrameView) -> Panel:
        """Return the board of a question, at its place and with what its surface asks for."""
        if board.at is not None:
            prompt, labels = self.words_of(response)
            return Panel(prompt, labels, board.at, board.size_m or SIZE_M)
        panel = self.board_of(response, view.head, view.surface)
        return panel if board.size_m is None else replace(panel, size_m=board.size_m)

    def board_of(self, response: Response, head: Pose, surface: Surface) -> Panel:
        """Return the usual board of a question, for a head and what it looks at."""
        prompt, labels = self.words_of(response)
        texts, values, ends = self.settings.texts, self.settings.values, ("", "")
        own = tuple(
            texts.find(f"ends.{response.name}.{end}", values=values) for end in ("low", "high")
        )
        if any(own):
            ends = (own[0] or "", own[1] or "")
        elif isinstance(response, Rating) and surface.screen is not None:
            if not self.has_own_prompt(response):
                prompt = self.bare_prompt(response)
                ends = (texts.get("ends.low"), texts.get("ends.high"))
        hint = "" if surface.screen is None else texts.get("board_keys")
        return board_before(head, surface, prompt, labels, ends=ends, hint=hint)

    def has_own_prompt(self, rating: Rating) -> bool:
        """Tell whether the study has words of its own for a rating and its ends."""
        texts = self.settings.texts
        return f"questions.{rating.name}" in texts.entries or "rating" in texts.own

    def bare_prompt(self, response: Response) -> str:
        """Return the words of a question that has no text of its own, without those of its ends."""
        name = response.name.replace("_", " ")
        return self.settings.texts.get("question", {**self.settings.values, "name": name})

    def _board_shown(self, over_scene: bool) -> Callable[[FrameView, Panel], Show | None]:
        staged_scene = self._staged_scene if over_scene else None
        last: list[tuple[SceneFrame, int | None]] = []

        def show(view: FrameView, panel: Panel) -> Show | None:
            elapsed_ns = view.t_ns - self._onset_ns
            behind = None if staged_scene is None else staged_scene.frame(view, elapsed_ns)
            if last and behind is None and last[-1][1] == panel.highlighted:
                return None
            if behind is None and last:
                behind = last[-1][0]
            elif behind is None:
                before = None if staged_scene is None else self._lit_frame
                behind = before or dark_frame(view.t_ns)
            last[:] = [(behind, panel.highlighted)]
            if isinstance(behind, PanelFrame):
                return Show(replace(behind, t_ns=view.t_ns, panels=(panel,)))
            return Show(
                PanelFrame(
                    behind.scene,
                    view.t_ns,
                    behind.gaze_direction,
                    behind.eye_openness_01,
                    behind.people,
                    behind.gaze_distance_m,
                    behind.turned_deg,
                    behind.window_at,
                    panels=(panel,),
                )
            )

        return show

    def _clear(self, over_scene: bool, view: FrameView) -> Performing:
        if not over_scene:
            yield dark_view(view.t_ns)

    def _wait(self, seconds: float) -> Performing:
        view = yield from self._now()
        scene = self._staged_scene
        passing = None if scene is None else PassingScene(scene, self._onset_ns)
        yield from self._until(view.t_ns + round(seconds * NS_PER_S), passing)
        yield from self._tell_turns()

    def _vibrate(
        self, role: str, pattern: VibrationPattern, motors: tuple[int, ...], amplitude_01: float
    ) -> Performing:
        yield from self._now()
        yield Play(role, pattern, motors, amplitude_01)
        yield Mark("vibrated", {"trial_id": self.trial.trial_id, "role": role})

    def _mark(self, name: str, payload: Mapping[str, Scalar | None]) -> Performing:
        yield from self._now()
        yield Mark(name, {"trial_id": self.trial.trial_id, **payload})

    def _repeat(self, reason: str, at_most: int) -> Performing:
        yield from self._now()
        if self.settings.repeats.get(self.trial.trial_id, 0) >= at_most:
            return False
        yield from self._wish_for(Repeat(reason))
        return True

    def _wish_for(self, wish: Repeat | EndEarly) -> Performing:
        yield from self._now()
        if self.wish is not None:
            raise DesignError(
                f"trial {self.trial.trial_id} asks for its repetition and for an early end, or for "
                "one of them twice; ask for an end only where t.repeat gave False: "
                "`if not (yield t.repeat(…)): yield t.end(…)`"
            )
        self.wish = wish

    def _walk_to(self, place: tuple[float, float], within_m: float, limit_s: float) -> Performing:
        view = yield from self._now()
        began_ns, is_there = view.t_ns, False
        until_ns = began_ns + round(limit_s * NS_PER_S)
        while view.t_ns < until_ns:
            x, _, z = view.head.position_m.tolist()
            if view.head_valid and np.hypot(x - place[0], z - place[1]) <= within_m:
                is_there = True
                break
            view = yield from self._on_to_next(view)
        took = (view.t_ns - began_ns) / NS_PER_MS
        self.row |= {"walk_ms": took if is_there else None, "walk_reached": is_there}
        return is_there


STEPS: Final = frozenset(
    name
    for name in dir(TrialScript)
    if not name.startswith("_")
    and getattr(getattr(TrialScript, name), "__annotations__", {}).get("return") is Action
)
"""The steps of a trial; each has to be yielded."""

TrialPlan: TypeAlias = Callable[[TrialScript], Iterator[Action | Step]]
"""A study's trial: a generator over its script."""
