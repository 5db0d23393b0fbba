"""Read a study's trials without performing them: what is shown, asked, and how long it takes.

A trial is a generator, so it can be run through with made-up replies: every condition once, so
that the needs of the study (agents, responses, devices, time) are known in advance.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Pose
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import (
    Ask,
    AskReply,
    FrameView,
    GazeView,
    Mark,
    NextFrame,
    Prompt,
    Show,
)
from visavis.stimuli.gaze_window import GAZE_WINDOW
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.view_turns import ARROWS
from visavis.study.actions import Action, PlayedSound, ShownScene, Source
from visavis.study.asking import Answer
from visavis.study.background import BackgroundExecutor
from visavis.study.distances import agent_of
from visavis.study.films import LiveFilm, Stimulus
from visavis.study.gaze_on import ENDINGS as GAZE_ENDINGS
from visavis.study.gaze_window import ENDINGS as WINDOW_ENDINGS
from visavis.study.lit_trial import SCENE_STREAM
from visavis.study.live import Live, LiveScene, Moulded
from visavis.study.quest_plus import QuestPlus
from visavis.study.responses import Keys, Response
from visavis.study.scenes import Scene, StagedScene, Staging, stage
from visavis.study.showing import sound_columns
from visavis.study.staircase import Staircase
from visavis.study.study_errors import explain, line_of, line_reached
from visavis.study.trial import TrialPlan, TrialScript
from visavis.study.trial_settings import Settings

MAX_STEPS: Final = 100_000
ANSWER_S: Final = 2.5
"""Assumed duration of a question in seconds; only its answer ends it."""
FRAME_S: Final = 0.25
"""Assumed time between frames that a trial requests itself, in seconds."""


SCENE_ENDINGS: Final = ("on_ns", "off_ns", "frames")
"""Endings of the columns that a shown scene adds, beside those of its roles."""
STEPS_OF_A_PAGE: Final = ("ask", "dark", "hush", "wait", "mark", "repeat", "end")
"""Steps that a page can perform besides films."""


@dataclass(frozen=True)
class TrialRead:
    """What one trial shows, asks and needs."""

    seconds: float
    responses: tuple[Response, ...]
    scenes: tuple[Scene, ...]
    agents: int
    vibrates: bool
    lit_frame: SceneFrame | None = None
    """The first lit frame of a trial that shows scenes frame by frame itself."""
    films: tuple[Stimulus, ...] = ()
    roles: frozenset[str] = frozenset()
    """The roles in any of the scenes."""
    fits_a_page: bool = True
    """Whether a page can perform it: no step needs single frames or another device."""
    sounds: tuple[Source, ...] = ()
    """The sounds that it plays."""
    sound_columns: tuple[str, ...] = ()
    """The columns with the onsets of these sounds."""
    lives: Mapping[str, Live | LiveFilm] = field(default_factory=dict)
    """What it shows that is drawn live, in order, by the names under which they are recorded."""
    scene_columns: tuple[str, ...] = ()
    """The columns that its scenes and films add."""
    row_columns: tuple[str, ...] = ()
    """The columns that the trial itself writes into its row, answers and sounds left out."""
    vibrating_roles: tuple[str, ...] = ()
    """The armbands that it lets vibrate."""
    dressings: frozenset[str] = frozenset()
    """What makes pictures of its scenes: "module:function"."""
    staircases: tuple[Staircase | QuestPlus, ...] = ()
    """The staircases of which a level is asked."""
    still_staircases: frozenset[str] = frozenset()
    """The names of those that hear nothing of an answer."""
    areas_of: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """The names of the areas of interest in each of its flat stimuli, by how its columns begin."""
    rests_on: frozenset[str] = frozenset()
    """What steps cannot do without: "gaze" that ends one or moves its window ("gaze_window"), a
    "pointer" whose window shows one, a "panorama" that is all around, a "room" of the laboratory's
    own."""

    @property
    def areas(self) -> frozenset[str]:
        """The names of the areas of interest in its flat stimuli."""
        return frozenset().union(*self.areas_of.values())


def still_view(t_ns: int = 0) -> FrameView:
    """Return a frame in which nothing happened: the head at rest, no gaze, no press."""
    gaze = GazeView(
        np.empty(0, np.int64), np.empty(0, np.bool_), np.empty((0, 3)), np.empty((0, 3)),
        np.empty((0, 0)), np.empty((0, 0)), np.empty((0, 0)), np.empty(0, np.int16),
    )  # fmt: skip
    head = Pose(np.array([0.0, 1.2, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    return FrameView(0, t_ns, head, True, gaze)


def first_lit(plan: TrialPlan, trial: Trial, settings: Settings) -> SceneFrame | None:
    """Return the first lit frame of a trial before it is performed; None where it shows none.

    The memory that earlier trials would have left is empty.
    """
    apart = replace(settings, memory={}, beside=BackgroundExecutor())
    return read_trial(plan, trial, apart, stops_when_lit=True).lit_frame


def read_trial(
    plan: TrialPlan, trial: Trial, settings: Settings, *, stops_when_lit: bool = False
) -> TrialRead:
    """Run through a trial with made-up replies; `stops_when_lit` ends at the first lit frame.

    Raises:
        DesignError: the trial cannot be run through, with its condition and the reason.
    """
    script = TrialScript(trial, settings)
    script.is_read = True
    seconds, agents, vibrates, fits_a_page, lit_on_page = 0.0, 0, False, True, False
    has_panorama = has_room = False
    lit_frame: SceneFrame | None = None
    staged_scene: StagedScene | None = None
    responses: list[Response] = []
    scenes: list[Scene] = []
    films: list[Stimulus] = []
    lives: dict[str, Live | LiveFilm] = {}
    sounds: list[Source] = []
    sound_onsets: list[str] = []
    scene_columns: list[str] = []
    vibrating_roles: list[str] = []
    roles: set[str] = set()
    areas_of: dict[str, frozenset[str]] = {}
    rests_on: set[str] = set()
    dressings: set[str] = set()
    reply: Any = None
    steps: Any = plan(script)
    try:
        for _ in range(MAX_STEPS):
            step = steps.send(reply)
            reply = None
            if not isinstance(step, Action | Mark):
                fits_a_page = False
            if isinstance(step, Action):
                on_page = step.viewing is not None or step.moulding is not None
                # A page times a press from what it shows: a showing before it, of a known length.
                on_page |= step.showing is not None or (step.name == "key" and lit_on_page)
                fits_a_page &= on_page or step.name in STEPS_OF_A_PAGE
                if step.name not in ("dark", "wait"):
                    lit_on_page = step.showing is not None and step.response is None
                seconds += step.seconds
                script.view = still_view(round(seconds * NS_PER_S))
                vibrates = vibrates or step.name == "vibrate"
                rests_on |= {"gaze"} if step.gaze_on is not None else set()
                is_by_pointer = step.showing is not None and step.showing.window_deg > 0
                rests_on |= {"pointer"} if is_by_pointer else set()
                vibrating_roles += [step.role] if step.role else []
                # Every reply has the type and columns of the real one: the trial may go on with it.
                if step.sound is not None:
                    sounds.append(step.sound)
                    sound_onsets.append(f"{script.next_prefix(step.column)}_on_ns")
                    script.row[sound_onsets[-1]] = script.now_ns
                    lasts_s = settings.seconds_of(step.sound)
                    reply = PlayedSound(script.now_ns, lasts_s)
                    seconds += lasts_s if step.waits_for_end else 0.0
                if step.name == "dark":
                    staged_scene = None
                if step.scene is not None:
                    scenes.append(step.scene)
                    chance = trial.rng(SCENE_STREAM + len(scenes) - 1)  # as in the session
                    may_lack = settings.files_gone is not None
                    staging = Staging(
                        chance, step.seconds, 0, settings.folder, may_lack_files=may_lack
                    )
                    staged_scene = stage(step.scene, staging, settings.makers)
                    if stops_when_lit and staged_scene.scene.brightness_01 > 0:
                        lit_frame = staged_scene.frame(script.view, 0)
                    agents = max(agents, len(staged_scene.scene.agents))
                    roles |= set(staged_scene.roles)
                    dressings.add(staged_scene.scene.dressed_by)
                    prefix = script.next_prefix(step.column)
                    sheets = getattr(staged_scene, "areas", ())
                    names = {area.name for one in sheets for area in one.areas}
                    # Whose picture is gone has a place no more, but its name.
                    names.update(filter(None, step.scene.options.get("names", ())))
                    areas_of[prefix] = frozenset(names)
                    sounds += step.sounds
                    onsets = sound_columns(prefix, len(step.sounds))
                    sound_onsets += onsets
                    script.row |= dict.fromkeys(onsets, script.now_ns)
                    endings = (*SCENE_ENDINGS, *staged_scene.roles)
                    scene_columns += [f"{prefix}_{ending}" for ending in endings]
                    has_panorama = has_panorama or "panorama" in step.scene.options
                    if GAZE_WINDOW in step.scene.options:
                        rests_on |= {"gaze", GAZE_WINDOW}
                        scene_columns += [f"{prefix}{ending}" for ending, _, _ in WINDOW_ENDINGS]
                    has_room = has_room or staged_scene.scene.room is not None
                    if step.gaze_on is not None:
                        step.gaze_on.watch(staged_scene)
                        scene_columns += [f"{prefix}{ending}" for ending, _, _ in GAZE_ENDINGS]
                    reply = ShownScene(
                        0, round(step.seconds * NS_PER_S), staged_scene.roles, script.view
                    )
                if step.name == "repeat":
                    reply = False
                if isinstance(step.response, Keys) and step.response.distance_to is not None:
                    agent_of(step.response.distance_to, staged_scene)
                if has_panorama and isinstance(step.response, Keys):
                    _refuse_arrows(step.response)
                answers = {}
                for response in step.responses:
                    if any(r.name == response.name and r != response for r in responses):
                        raise DesignError(
                            f"it asks two questions called {response.name!r}, of which only the "
                            "last would be recorded as the answer; name one otherwise"
                        )
                    responses.append(response)
                    script.words_of(response)
                    seconds += ANSWER_S
                    reply = answers[response.name] = _answer_to(response, script.view)
                    if reply.option is not None:
                        script.row[response.name] = response.value(reply.option)
                        script.row |= response.more(reply.option)
                if step.viewing is not None:
                    stimulus, reply = step.viewing.stimulus, answers
                    if isinstance(stimulus, LiveScene):
                        lives[script.next_prefix("live")] = stimulus.live
                    elif isinstance(stimulus, LiveFilm):
                        lives[script.next_prefix("live")] = stimulus
                    else:
                        films.append(stimulus)
                if step.moulding is not None:
                    lives[script.next_prefix("mould")] = step.moulding.live
                    starts = {s.name: s.start for s in step.moulding.sliders}
                    script.row |= starts
                    reply = Moulded(starts, (), "button", ANSWER_S * len(starts))
            # Steps of the engine, which a study uses where it needs single frames.
            elif isinstance(step, NextFrame):
                # The first frame that is not quiet comes back, as in a session.
                quiet_s = step.quiet_until_ns / NS_PER_S - seconds
                seconds += FRAME_S * max(1, math.ceil(quiet_s / FRAME_S))
                reply = script.view = still_view(round(seconds * NS_PER_S))
            elif isinstance(step, Show):
                agents = max(agents, len(step.view.scene.agents))
                dressings.add(step.view.scene.dressed_by)
                if lit_frame is None and step.view.scene.brightness_01 > 0:
                    lit_frame = step.view
            elif isinstance(step, Ask):
                reply = AskReply(step.options[0] if step.options else "", 0)
            elif isinstance(step, Prompt):
                reply = AskReply(None, 0)
            if stops_when_lit and lit_frame is not None:
                break
        else:
            raise DesignError(f"after {MAX_STEPS} steps it has not ended")
        # Stopped at the first light: questions and later scenes were not reached.
        steps.close()
        return TrialRead(seconds, (), tuple(scenes), agents, vibrates, lit_frame)
    except StopIteration as end:
        own = {*script.row, *(end.value or ())}
        by_kit = {*sound_onsets, *scene_columns, *(c.name for r in responses for c in r.columns())}
        return TrialRead(
            seconds,
            tuple(responses),
            tuple(scenes),
            agents,
            vibrates,
            lit_frame,
            tuple(films),
            frozenset(roles),
            fits_a_page,
            tuple(sounds),
            tuple(sound_onsets),
            lives,
            scene_columns=tuple(scene_columns),
            row_columns=tuple(sorted(map(str, own - by_kit))),
            vibrating_roles=tuple(dict.fromkeys(vibrating_roles)),
            dressings=frozenset(dressings - {""}),
            staircases=tuple(script.staircases.values()),
            still_staircases=frozenset(
                name for name in script.staircases if script.row[f"{name}_is_right"] is None
            ),
            areas_of=areas_of,
            rests_on=frozenset(
                rests_on
                | ({"panorama"} if has_panorama else set())
                | ({"room"} if has_room else set())
            ),
        )
    except (DesignError, TypeError) as error:
        reason = explain(error)
        if isinstance(error, TypeError) and reason.startswith(TypeError.__name__):
            raise  # no wrong argument of the kit: show it unchanged
        place = line_of(error) or line_reached(steps)
        at = f"{place}: " if place else ""
        condition = ", ".join(f"{name} {level}" for name, level in trial.factors.items())
        raise DesignError(f"{at}trial of {condition}: {reason}") from error


def read_trials(
    plan: TrialPlan, trials: Iterable[Trial], settings: Settings
) -> Mapping[tuple[tuple[str, Any], ...], TrialRead]:
    """Run through every condition among some trials once."""
    by_condition: dict[tuple[tuple[str, Any], ...], TrialRead] = {}
    for trial in trials:
        key = (*sorted(trial.factors.items()), ("practice", trial.is_practice))
        if key not in by_condition:
            by_condition[key] = read_trial(plan, trial, settings)
    return by_condition


def _refuse_arrows(keys: Keys) -> None:
    """Refuse keys that turn the view onto a panorama.

    Raises:
        DesignError: one of them does.
    """
    turning = sorted(ARROWS.keys() & set(map(str, keys.options)))
    if turning:
        raise DesignError(
            f"{', '.join(turning)}: arrow keys turn the view onto a panorama before a monitor; "
            f"answer {keys.name} by other keys"
        )


def _answer_to(response: Response, view: FrameView) -> Answer:
    option = str(response.options[0]) if response.options else "0"
    is_right = response.more(option).get(f"{response.name}_is_right")
    return Answer(option, "keys", 0, 0, view, is_right=None if is_right is None else bool(is_right))
