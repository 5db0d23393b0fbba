"""What is lit during a trial, frame by frame: the dark, scenes, and flat stimuli to the frame."""

from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.lab.yaml_lines import names_or_none
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import FrameView, Mark, PlaySound, Scalar
from visavis.protocol.session.boards import NOTHING_IN_TIME
from visavis.stimuli.areas import areas_text
from visavis.stimuli.audible import gain_db_of
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.flat import FlatScene
from visavis.stimuli.sound import part_of
from visavis.stimuli.view_turns import VIEW_TURNED
from visavis.study.actions import Performing, ShownScene
from visavis.study.asking import Answer, frame, press_in, presses_of
from visavis.study.distances import floor_distances_m
from visavis.study.film_pictures import FilmPictures
from visavis.study.films import Film
from visavis.study.frames import dark_view, gaze_has_arrived, show_frame
from visavis.study.gaze_on import GazeOn, GazeWatch
from visavis.study.lit_frames import LitFrames
from visavis.study.responses import Keys
from visavis.study.scenes import PAIR, PassingScene, Scene, StagedFlat, StagedScene, Staging, stage
from visavis.study.showing import Showing, sound_columns
from visavis.study.trial_settings import Settings

SCENE_STREAM: Final = 100
STAMP_LIMIT_S: Final = 1.0
"""How long a trial waits for the report that a sound began."""
Until: TypeAlias = Callable[[FrameView], bool] | GazeOn
"""What ends a showing before its time."""


class LitTrial:
    """The light of one trial: its current frame, what is shown, and the columns of both."""

    def __init__(self, trial: Trial, settings: Settings) -> None:
        self.trial = trial
        self.settings = settings
        self.row: dict[str, Scalar | None] = {}
        self.view: FrameView | None = None
        self._staged_scene: StagedScene | None = None
        self._gone_scene: StagedScene | None = None
        """What was lit before the dark, and until when."""
        self._dark_ns = 0
        self._lit_frame: SceneFrame | None = None
        self._onset_ns = 0
        self._sound_on_ns = 0
        self._names: dict[str, int] = {}
        self._lit_column = ""
        self._gaze_watch: GazeWatch | None = None
        self._shown_as = ""
        self._film_pictures = FilmPictures((), 0)

    def _frame(
        self,
        quiet_until_ns: int = 0,
        update: Callable[[FrameView], SceneFrame | None] | None = None,
    ) -> Performing:
        self.view = yield from frame(quiet_until_ns, update)
        return self.view

    def _now(self) -> Performing:
        """Return the latest frame; the first of a trial has to be waited for."""
        if self.view is None:
            yield from self._frame()
        return self.view

    def _until(
        self, until_ns: int, each_frame: Callable[[FrameView], SceneFrame | None] | None
    ) -> Performing:
        view = yield from self._now()
        while view.t_ns < until_ns:
            if each_frame is not None:
                yield from show_frame(each_frame(view))
            view = yield from self._frame(until_ns, each_frame)
        return view

    def _dark(self, seconds: float) -> Performing:
        view = yield from self._now()
        self.put_out()
        yield dark_view(view.t_ns)
        until_ns = view.t_ns + round(seconds * NS_PER_S)
        is_noted = not self._lit_column and (self._gone_scene is None or self._dark_ns > 0)
        if not is_noted and view.t_ns < until_ns:
            view = yield from self._frame()
            self.end_light(view.t_ns)
        yield from self._until(until_ns, None)

    def _light(self, showing: Showing) -> Performing:
        """Show a scene's first frame; return its columns' prefix, the scene, and that frame."""
        before = yield from self._now()
        name = self.next_prefix(showing.name)
        staged_scene = self._stage(showing.scene, showing.seconds, len(self._names), before.t_ns)
        if isinstance(staged_scene, StagedFlat) and staged_scene.films:
            # What stands there stays a frame at least, so that a film misses none of its own.
            staged_scene.open_films(before)
            before = yield from self._frame()
        self._staged_scene, self._onset_ns = staged_scene, before.t_ns
        self._sound_on_ns, self._shown_as = 0, name
        yield from show_frame(self._scene_update(before))
        yield from self._begin_sounds(showing, name)
        view = yield from self._frame()
        self.end_light(view.t_ns)
        self._gaze_watch = None
        self._onset_ns = view.t_ns
        self._film_pictures = FilmPictures((), 0)
        if isinstance(staged_scene, StagedFlat):
            since_ns = staged_scene.scene.moves_since_ns
            self._film_pictures = FilmPictures(staged_scene.films, since_ns)
            self._film_pictures.note(view.t_ns)
        self.row.setdefault("t_start_ns", view.t_ns)
        about = shown_event(self.trial.trial_id, name, showing.scene, staged_scene, before.t_ns)
        yield Mark("shown", about)
        return name, staged_scene, view

    def _begin_sounds(self, showing: Showing, name: str) -> Performing:
        """Let what is heard with a showing begin, all at once."""
        columns = sound_columns(name, len(showing.sounds))
        for sound, column in zip(showing.sounds, columns, strict=True):
            self.row[column] = None
            waveform = self.settings.sound_of(sound)
            yield PlaySound(column, waveform, None, gain_db_of(sound, waveform))

    def _onset_ns_of(self, showing: Showing, name: str, lit_ns: int, view: FrameView) -> int | None:
        """Return from when a showing is timed: what is heard alone from its first sample, all else
        from its first light; None while the report of the sound is awaited.
        """
        if not showing.is_heard_alone:
            return lit_ns
        began_ns = self.row[f"{name}_sound_on_ns"]
        if isinstance(began_ns, int):
            self._sound_on_ns = began_ns
            return began_ns
        return None if view.t_ns < lit_ns + round(STAMP_LIMIT_S * NS_PER_S) else lit_ns

    def _onset_of(self, showing: Showing, name: str, view: FrameView) -> Performing:
        """Return from when a showing is timed, the frame in which that is known, and how many have
        passed. The frame has the presses of all that passed.
        """
        lit_ns, frames, presses = view.t_ns, 1, presses_of(view)
        while (on_ns := self._onset_ns_of(showing, name, lit_ns, view)) is None:
            view = yield from self._frame()
            presses += presses_of(view)
            frames += 1
        if presses:
            pressed, pressed_ns = zip(*presses, strict=True)
            view = view._replace(pressed=pressed, pressed_ns=pressed_ns)
        return on_ns, view, frames

    def put_out(self) -> None:
        """Note that what is shown goes with the next frame."""
        if self._staged_scene is not None:
            self._gone_scene, self._dark_ns = self._staged_scene, 0
        self._staged_scene = None

    def end_light(self, t_ns: int) -> None:
        """Note that flat stimuli, and a scene that was put out, were lit up to now."""
        self._dark_ns = self._dark_ns or t_ns
        if self._lit_column:
            self.row[self._lit_column] = t_ns
            self._note_gaze(self._lit_column.removesuffix("_off_ns"), t_ns)
            self._lit_column = ""

    def _condition(
        self, until: Until | None, staged_scene: StagedScene, on_ns: int
    ) -> Callable[[FrameView], bool] | None:
        """Return what ends a showing; gaze that it waits for counts from its onset."""
        self._gaze_watch = until.watch(staged_scene, on_ns) if isinstance(until, GazeOn) else None
        return self._gaze_watch if isinstance(until, GazeOn) else until

    def _note_gaze(self, name: str, off_ns: int) -> None:
        """Note the gaze for which a showing waited that is over at a time."""
        if self._gaze_watch is not None:
            self.row |= self._gaze_watch.columns(name, off_ns)

    def _show_exactly(self, showing: Showing, ends: Until | None) -> Performing:
        """Show flat stimuli for so many frames, or the frames nearest to so many seconds.

        `NAME_off_ns` is the frame in which they were gone; where the trial ends before it, the one
        in which they would be.
        """
        name, staged_scene, view = yield from self._light(showing)
        lit_ns, frames = view.t_ns, self._lit_frames(1)
        until = self._condition(ends, staged_scene, lit_ns)
        while not (until is not None and until(view)):
            on_ns = self._onset_ns_of(showing, name, lit_ns, view)
            if on_ns is not None and showing.is_over(frames.count, view, on_ns):
                break
            quiet_until_ns = 0
            if until is None and on_ns is not None:
                quiet_until_ns = showing.calm_until_ns(view, on_ns)
            yield from self._follow(view)
            view = yield from self._frame(quiet_until_ns, frames)
            frames.note(view.t_ns)
        off_ns = view.t_ns + view.surface.frame_ns
        self._note_shown(name, staged_scene, lit_ns, off_ns, frames.count)
        return ShownScene(lit_ns, off_ns, staged_scene.roles, view)

    def _note_shown(
        self, name: str, staged_scene: StagedScene, on_ns: int, off_ns: int, frames: int
    ) -> None:
        columns = {f"{name}_on_ns": on_ns, f"{name}_off_ns": off_ns, f"{name}_frames": frames}
        self.row |= {**columns, **self._role_columns(name, staged_scene), "t_end_ns": off_ns}
        self.row |= self._film_pictures.columns(name)
        if isinstance(staged_scene, StagedFlat) and staged_scene.scene.gaze_window is not None:
            self.row |= staged_scene.course.columns(name)
        self._note_gaze(name, off_ns)
        self._lit_column = f"{name}_off_ns"

    def _role_columns(self, name: str, staged_scene: StagedScene) -> dict[str, int]:
        """Return which agent plays each role; places only where a measure asks for them."""
        places = {a.place for a in staged_scene.scene.agents}
        return {
            f"{name}_{role}": index
            for role, index in staged_scene.roles.items()
            if role in self.settings.measured_roles or role not in places
        }

    def _show_until_key(self, showing: Showing, keys: Keys) -> Performing:
        """Show something until a key is pressed; after its seconds wait for the key in the dark."""
        name, staged_scene, view = yield from self._light(showing)
        controls, lit_ns = tuple(keys.options), view.t_ns
        on_ns, view, frame_count = yield from self._onset_of(showing, name, view)
        frames = self._lit_frames(frame_count)
        until_ns = on_ns + round(keys.limit_s * NS_PER_S)
        answer = press_in(view, controls, on_ns, until_ns)
        while answer is None and view.t_ns < until_ns:
            if frames.is_lit and showing.is_over(frames.count, view, on_ns):
                off_ns = view.t_ns + view.surface.frame_ns
                self._note_shown(name, staged_scene, lit_ns, off_ns, frames.count)
                frames.is_lit = False
                self.put_out()
                yield dark_view(view.t_ns)
                view = yield from self._frame()
                self.end_light(view.t_ns)
            else:
                yield from self._follow(view)
                calm_ns = showing.calm_until_ns(view, on_ns) if frames.is_lit else until_ns
                view = yield from self._frame(min(calm_ns, until_ns), frames)
                frames.note(view.t_ns)
            answer = press_in(view, controls, on_ns, until_ns)
        if frames.is_lit:
            off_ns = view.t_ns + view.surface.frame_ns
            self._note_shown(name, staged_scene, lit_ns, off_ns, frames.count)
        if answer is None:
            answer = Answer(None, NOTHING_IN_TIME, on_ns, view.t_ns, view)
        return answer

    def _show(
        self,
        showing: Showing,
        ends: Until | None,
        heard: Film | None = None,
    ) -> Performing:
        staged_scene: StagedScene
        name, staged_scene, view = yield from self._light(showing)
        if heard is not None:
            yield from self._let_speak(heard, name, staged_scene)
        on_ns = view.t_ns
        end_ns = on_ns + round(showing.seconds * NS_PER_S)
        off_ns = end_ns
        passing = PassingScene(staged_scene, on_ns)
        until = self._condition(ends, staged_scene, on_ns)
        while True:
            if until is not None and until(view):
                off_ns = view.t_ns
                break
            if view.t_ns >= end_ns and gaze_has_arrived(view, end_ns):
                break
            yield from show_frame(passing(view))
            view = yield from self._frame(end_ns if until is None else 0, passing)
        self.row |= {
            f"{name}_on_ns": on_ns,
            f"{name}_off_ns": off_ns,
            f"{name}_frames": passing.frames + 1,
            **self._role_columns(name, staged_scene),
            "t_end_ns": off_ns,
        }
        self._note_gaze(name, off_ns)
        self._lit_frame = passing.last or self._lit_frame
        return ShownScene(on_ns, off_ns, staged_scene.roles, view)

    def _let_speak(self, film: Film, name: str, staged_scene: StagedScene) -> Performing:
        """Begin a film's sound: from its speaker's head, or of a pair from between both."""
        voice, agents = film.voice, staged_scene.scene.agents
        if voice is None:
            return
        who = staged_scene.roles.get(voice.speaker)
        if who is None:
            raise DesignError(
                f"{film.scene.name} is spoken by {voice.speaker!r}, whom nobody in it plays; "
                f"there are {names_or_none(staged_scene.roles)}"
            )
        speakers = agents if staged_scene.scene.name == PAIR else (agents[who],)
        x, y, z = (float(v) for v in np.mean([a.head_centre_m for a in speakers], axis=0))
        column = f"{name}_sound_on_ns"
        self.row[column] = None
        whole = self.settings.sound_of(self.settings.folder / voice.file)
        sound = part_of(whole, voice.from_s, film.frame_count / film.rate_hz)
        yield PlaySound(column, sound, (x, y, z), 0.0, loops=False)

    def _stage(self, scene: Scene, seconds: float, number: int, start_ns: int) -> StagedScene:
        rng = self.trial.rng(SCENE_STREAM + number)
        screen = None if self.view is None else self.view.surface.screen
        settings = self.settings
        staging = Staging(rng, seconds, start_ns, settings.folder, screen, settings.heads_move)
        return stage(scene, staging, settings.makers)

    def _follow(self, view: FrameView) -> Performing:
        """Show what the current scene shows after a frame, and tell what turned the view."""
        yield from show_frame(self._scene_update(view))
        yield from self._tell_turns()

    def _tell_turns(self) -> Performing:
        """Record what turned the view onto a panorama since the last call."""
        for turn in getattr(self._staged_scene, "new_turns", tuple)():
            about = {"trial_id": self.trial.trial_id, "name": self._shown_as}
            yield Mark(VIEW_TURNED, {**about, **turn})

    def _lit_frames(self, count: int) -> LitFrames:
        """Return what counts the quiet frames of what is shown, of which so many have passed."""
        scene = self._staged_scene
        stays = isinstance(scene, StagedFlat) and scene.stays
        return LitFrames(self._scene_update, self._film_pictures, count, stays=stays)

    def _scene_update(self, view: FrameView) -> SceneFrame | None:
        """Return the current scene's next frame; None without a change."""
        if self._staged_scene is None:
            return None
        coming = self._staged_scene.frame(view, view.t_ns - self._onset_ns)
        self._lit_frame = coming or self._lit_frame
        return coming

    def _distance_m(self, role: str, answer: Answer) -> float | None:
        """Return how far the person of a role was at an answer; None where that is not known."""
        frame, agent = self._lit_frame, -1
        scene = self._staged_scene
        if scene is None and answer.answered_ns < self._dark_ns:
            scene = self._gone_scene
        if scene is not None:
            agent = scene.roles.get(role, -1)
        if answer.option is None or frame is None or agent < 0 or not answer.view.head_valid:
            return None
        eyes_m = answer.view.head.position_m
        return float(floor_distances_m(frame, answer.answered_ns, eyes_m)[agent])

    def next_prefix(self, name: str) -> str:
        """Return the prefix of the next scene's or sound's columns: "scene", then "scene2"."""
        count = self._names[name] = self._names.get(name, 0) + 1
        return name if count == 1 else f"{name}{count}"


def shown_event(
    trial_id: str, name: str, scene: Scene, staged_scene: StagedScene, start_ns: int
) -> dict[str, Scalar | None]:
    """Return what the event "shown" says of a scene, whose columns begin with a name."""
    areas, flat = getattr(staged_scene, "areas", ()), staged_scene.scene
    return {
        "trial_id": trial_id,
        "name": name,
        **({"areas": areas_text(areas)} if areas else {}),
        **(_movement(flat) if isinstance(flat, FlatScene) else {}),
        "scene": scene.name,
        "start_ns": start_ns,
        **{
            f"option_{k}": v if isinstance(v, str | int | float | bool) else str(v)
            for k, v in scene.options.items()
        },
        **{f"role_{role}": index for role, index in staged_scene.roles.items()},
    }


def _movement(scene: FlatScene) -> dict[str, Scalar | None]:
    """Return since when a scene moves; nothing of one that stands still."""
    return {"moves_since_ns": scene.moves_since_ns} if scene.moves else {}
