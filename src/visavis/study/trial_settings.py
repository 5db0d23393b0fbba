"""What all trials of a study share, and which of their questions are asked on a board."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from visavis.lab.errors import DataError, DesignError
from visavis.protocol.session.boards import Ways
from visavis.stimuli.area_paths import FilesGone, is_gone
from visavis.stimuli.audible import Audible, Sound, Tone, at_ear, gain_db_of, tone_waveform
from visavis.stimuli.film_file import facts_of
from visavis.stimuli.flat import Panorama, Video
from visavis.stimuli.sound import Waveform, read_sound
from visavis.study.actions import Source
from visavis.study.background import BackgroundExecutor
from visavis.study.responses import FreeText, Number, Pointing, Response
from visavis.study.scenes import Maker
from visavis.study.texts import Texts


@dataclass(frozen=True)
class Settings:
    """What every trial of a study shares: its parameters, words, scenes and ways of answering.

    `memory` is what trials of one session leave for later ones, `beside` performs work that would
    delay a frame.
    """

    parameters: Mapping[str, Any]
    texts: Texts
    values: Mapping[str, Any]
    makers: Mapping[str, Maker]
    ways: Ways
    answer_by: str
    folder: Path
    memory: dict[str, Any] = field(default_factory=dict)
    rows: list[Mapping[str, Any]] = field(default_factory=list)
    """The rows of this session's finished trials, those of a part before among them."""
    repeats: dict[str, int] = field(default_factory=dict)
    """How often each trial of this session has been repeated because it asked for it."""
    beside: BackgroundExecutor = field(default_factory=BackgroundExecutor)
    sounds: dict[Path | Audible, Waveform] = field(default_factory=dict)
    measured_roles: frozenset[str] = frozenset()
    """Roles with a measure: a row names them even if the role is a place."""
    held_answers: frozenset[str] = frozenset()
    """Answers of which is measured how long their key is held."""
    heads_move: bool = True
    """False repeats a session of an older version: see `Staging.heads_move`."""
    files_gone: FilesGone | None = None
    """Where it is given, files of pictures and films that are shown, and of their areas, may be
    gone, and are noted there: a recording has what was measured. None refuses it."""

    def note_repeat(self, trial_id: str) -> None:
        """Note that a trial comes again because it asked for it."""
        self.repeats[trial_id] = self.repeats.get(trial_id, 0) + 1

    def sound_of(self, source: Source) -> Waveform:
        """Return what is played; files are read once.

        Raises:
            DesignError: the file cannot be played, or not at its level.
        """
        if isinstance(source, Waveform):
            return source
        if source not in self.sounds:
            try:
                self.sounds[source] = self._read(source)
            except DataError as problem:
                step = "play" if isinstance(source, Path) else "show"
                raise DesignError(f"t.{step}: {problem}") from problem
        return self.sounds[source]

    def seconds_of(self, source: Source) -> float:
        """Return how long a sound lasts; 0 if its file is missing, as in an analysis elsewhere."""
        try:
            return self.sound_of(source).duration_s
        except DesignError:
            return 0.0

    def film_seconds(self, film: Video | Panorama) -> float:
        """Return how long a film lasts; of a recording 0 if its file is gone, as of sounds."""
        if self.files_gone is not None and is_gone(film, self.folder):
            self.files_gone.hides_lengths = True
            return 0.0
        return facts_of(film, self.folder).seconds

    def film_sounds(self, film: Video | Panorama) -> tuple[Sound, ...]:
        """Return what is heard with a film; nothing of a silent one, or where its file is not."""
        if not film.is_heard or is_gone(film, self.folder):
            return ()
        return (Sound(film.file, film.level_db),) if facts_of(film, self.folder).has_sound else ()

    def _read(self, source: Path | Audible) -> Waveform:
        if isinstance(source, Path):
            return read_sound(source)
        if isinstance(source, Tone):
            return tone_waveform(source)
        sound = at_ear(read_sound(self.folder / source.file), source.ear)
        gain_db_of(source, sound)
        return sound


def is_on_board(response: Response, settings: Settings) -> bool:
    """Tell whether a response is asked for on a board before the participant."""
    is_elsewhere = isinstance(response, FreeText | Number | Pointing)
    return not is_elsewhere and settings.answer_by != "keyboard"
