"""What is heard during a trial: sounds that are played, from a place or to both ears."""

from pathlib import Path
from typing import Literal, TypeAlias

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.lab.kinds import takes_kinds
from visavis.protocol.plan.steps import FrameView, Hush, PlaySound, SoundOnset
from visavis.stimuli.audible import MAX_GAIN_DB
from visavis.stimuli.moving_heads import agents_at
from visavis.stimuli.scene import Agent
from visavis.stimuli.sound import Waveform
from visavis.study.actions import Action, Performing, PlayedSound
from visavis.study.frames import show_frame
from visavis.study.lit_trial import STAMP_LIMIT_S, LitTrial

Wait: TypeAlias = Literal["onset", "end", "no"]


class HeardTrial(LitTrial):
    """The sounds of one trial, over its light."""

    @takes_kinds()
    def play(
        self,
        sound: str | Path | Waveform,
        *,
        at: str | tuple[float, float, float] | None = None,
        gain_db: float = 0.0,
        loops: bool = False,
        wait: Wait = "onset",
        name: str = "sound",
    ) -> Action:
        """Play a sound: a file beside the study file (WAV, FLAC, OGG), or a `Waveform`.

        `at` is its source: a role or place of the current scene (that person's head), or a point in
        world (metres). Its level is as recorded at 1 m, and it is heard from the head's pose. None
        plays it to both ears unchanged. The trial goes on with the sound's `onset` (a few frames),
        its `end`, or at once (`no`); all sounds end with the trial. Column: `NAME_on_ns`, when its
        first sample left the sound card, empty where it was not reported. The step returns a
        `PlayedSound`.

        Raises:
            DesignError: a value is not possible; for files, when the session is prepared.
        """
        if wait == "end" and loops:
            raise DesignError("t.play: a sound that loops has no end to wait for")
        if not -120.0 <= gain_db <= MAX_GAIN_DB:
            raise DesignError(f"t.play: gain_db is {gain_db:g}; from -120 to {MAX_GAIN_DB:g}")
        source = sound if isinstance(sound, Waveform) else self.settings.folder / sound
        return Action(
            "play",
            lambda: self._play(self.settings.sound_of(source), at, gain_db, loops, wait, name),
            sound=source,
            column=name,
            waits_for_end=wait == "end",
        )

    def hush(self) -> Action:
        """End all sounds."""
        return Action("hush", self._hush)

    def _play(
        self,
        sound: Waveform,
        at: str | tuple[float, float, float] | None,
        gain_db: float,
        loops: bool,
        wait: Wait,
        name: str,
    ) -> Performing:
        view = yield from self._now()
        column = f"{self.next_prefix(name)}_on_ns"
        self.row[column] = None
        yield PlaySound(column, sound, self._place_of(at, view.t_ns), gain_db, loops)
        if wait != "no":
            until_ns = view.t_ns + round(STAMP_LIMIT_S * NS_PER_S)
            while self.row[column] is None and view.t_ns < until_ns:
                view = yield from self._on_to_next(view)
        on_ns = self.row[column]
        began_ns = on_ns if isinstance(on_ns, int) else None
        self._sound_on_ns = began_ns or 0
        if wait == "end" and began_ns is not None:
            end_ns = began_ns + round(sound.duration_s * NS_PER_S)
            yield from self._until(end_ns, self._scene_update)
        return PlayedSound(began_ns, sound.duration_s)

    def _on_to_next(self, view: FrameView) -> Performing:
        yield from show_frame(self._scene_update(view))
        return (yield from self._frame())

    def _place_of(
        self, at: str | tuple[float, float, float] | None, t_ns: int
    ) -> tuple[float, float, float] | None:
        if not isinstance(at, str):
            return at
        roles = {} if self._staged_scene is None else self._staged_scene.roles
        agents = self._agents_at(t_ns)
        heads = {agent.place: agent for agent in agents} | {
            role: agents[index] for role, index in roles.items()
        }
        if at not in heads:
            raise DesignError(
                f"t.play: nobody in what is shown is {at!r}; "
                + (f"there are {', '.join(heads)}" if heads else "show a scene first")
            )
        x, y, z = (float(v) for v in heads[at].head_centre_m)
        return x, y, z

    def store_onsets(self, sounds: tuple[SoundOnset, ...]) -> None:
        """Store the onsets of sounds."""
        for sound in sounds:
            self.row[sound.key] = sound.on_ns

    def _hush(self) -> Performing:
        yield from self._now()
        yield Hush()

    def _agents_at(self, t_ns: int) -> tuple[Agent, ...]:
        return () if self._staged_scene is None else agents_at(self._staged_scene.scene, t_ns)
