"""Studies from a script: their data as pandas frames, and whole studies simulated and analysed.

import visavis

study = visavis.open_study("data/simulated/duel")
trials = study.trials()
gaze = study.session("S01B").stream("gaze")
"""

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import pandas as pd

from visavis.devices.registry import OPTION_MODELS
from visavis.lab.clock import SystemClock
from visavis.lab.config import LabConfig, load_config, parse_config, with_devices
from visavis.lab.config_files import CONFIG_NAME, EXAMPLE, find_config
from visavis.lab.errors import ConfigError, UsageError
from visavis.lab.yaml_lines import names_or_none
from visavis.protocol.people.identifiers import means_label
from visavis.recording.folder import SIMULATED_ROOT
from visavis.recording.reader import Recording, components_of
from visavis.results.analysis import StudyAnalysis
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.results.picture_delay import SETTING
from visavis.running.sessions.damage import require_intact
from visavis.running.sessions.intake_list import intake_list
from visavis.running.sessions.plan_lock import check_interim_analysis, read_lock
from visavis.running.sessions.session_list import require_whole
from visavis.running.sessions.studies import QuietNotifier, analyse_study, simulate_study
from visavis.running.sessions.study_folder import (
    DEFAULT_SEED,
    DERIVED_FOLDER,
    StudySettings,
    sessions_of,
    study_of_folder,
    wanted_settings,
)
from visavis.study.cast import use_recorded_cast


class StreamTable(pd.DataFrame):
    """A stream as a frame that knows its fields, too: `gaze["direction_world"]` is three columns.

    What it has not raises a KeyError with the names it has. Rows that are selected know them, too.
    """

    @property
    def _constructor(self) -> type["StreamTable"]:
        return StreamTable

    def __getitem__(self, key: Any) -> Any:
        """Return a column, or the columns of a field of several numbers."""
        if not isinstance(key, str) or key in self.columns:
            return super().__getitem__(key)
        parts = components_of(key, list(self.columns))
        if not parts:
            raise KeyError(f"no {key!r}; there are {names_or_none(self.columns)}")
        return super().__getitem__(parts)


class _Terminal(QuietNotifier):
    """Shows progress where somebody looks: in a terminal, or a notebook."""

    def progress(self, what: str) -> AbstractContextManager[Callable[[int, int], None]]:
        """Return a context with a function to call with the amount done and the total."""
        if not (sys.stderr.isatty() or "ipykernel" in sys.modules):
            return super().progress(what)

        def show(count: int, total: int) -> None:
            sys.stderr.write(f"\r{what} {count} of {total}" + ("\n" if count == total else ""))
            sys.stderr.flush()

        return nullcontext(show)


NOTIFIER: Final = _Terminal()


@dataclass(frozen=True)
class Session:
    """One recorded session, read only."""

    path: Path
    recording: Recording = field(repr=False)

    @property
    def participant(self) -> str:
        """The participant's label in the ledger."""
        return self.recording.manifest.participant

    @property
    def is_simulated(self) -> bool:
        """Whether no person took part, or devices were simulated."""
        return self.recording.is_simulated

    @property
    def streams(self) -> tuple[str, ...]:
        """The names of its streams."""
        return tuple(self.recording.stream_names)

    def stream(self, name: str) -> pd.DataFrame:
        """Return a stream, one row per sample: `seq`, `t_device_ns`, `t_host_ns` and its fields.

        A field of several numbers is a column each (`direction_head_x`); the field itself
        (`direction_head`) is these columns together. Units and meanings: `columns`.

        Raises:
            UsageError: the session has no such stream.
        """
        return StreamTable(self.recording.stream(name))

    def columns(self, name: str) -> pd.DataFrame:
        """Return what the fields of a stream are: name, unit, frame, description."""
        schema = self.recording.stream_schema(name)
        fields = () if schema is None else schema.fields
        return pd.DataFrame(
            [(f.name, f.unit, f.frame, f.description) for f in fields],
            columns=["name", "unit", "frame", "description"],
        )

    def events(self) -> pd.DataFrame:
        """Return every event: name, time, payload."""
        return self.recording.events()

    def trials(self) -> pd.DataFrame:
        """Return the trials as the session wrote them, unmeasured."""
        return self.recording.trials()

    @property
    def plan(self) -> Mapping[str, Any]:
        """What was planned."""
        content: Mapping[str, Any] = self.recording.manifest.plan
        return content


@dataclass(frozen=True)
class StudyData:
    """The data of a study: sessions, trials, participants, streams."""

    path: Path
    study: OpenedStudy = field(repr=False)
    accept_damage: bool = False
    """Whether damaged recordings are measured as well, as far as they can be read."""

    @cached_property
    def sessions(self) -> tuple[Session, ...]:
        """Every session, by participant and number."""
        return tuple(Session(p, Recording(p)) for p in sessions_of(self.path))

    def session(self, participant: str | int, number: int = 1) -> Session:
        """Return one session of a participant: "S02C", "02C", "2" and 2 mean the same.

        Raises:
            UsageError: there is none.
        """
        for session in self.sessions:
            manifest = session.recording.manifest
            is_theirs = means_label(str(participant), manifest.participant)
            if is_theirs and manifest.session == number:
                return session
        names = ", ".join(dict.fromkeys(s.participant for s in self.sessions))
        raise UsageError(
            f"{self.path} has no session {number} of {str(participant)!r}; there are {names}"
        )

    def __iter__(self) -> Iterator[Session]:
        """Yield every session."""
        return iter(self.sessions)

    @cached_property
    def _intakes(self) -> tuple[Any, ...]:
        return self._taken_in({})

    def _taken_in(self, how: Mapping[str, Any]) -> tuple[Any, ...]:
        paths = intake_list([s.path for s in self.sessions]).sessions
        require_whole(self.path, accept=self.accept_damage)
        require_intact(paths, accept=self.accept_damage)
        measured = []
        with NOTIFIER.progress("measuring") as report_progress:
            for count, path in enumerate(paths):
                report_progress(count, len(paths))
                measured.append(self.study.measure(Recording(path), how))
            report_progress(len(paths), len(paths))
        return tuple(measured)

    def trials(self) -> pd.DataFrame:
        """Return every trial, measured from the recordings; one row each. A terminal or notebook
        shows how many sessions are measured.

        `is_analysed` says what counts and `left_out_because` why not.
        """
        return self.analysis().selection.rows

    def participants(self) -> pd.DataFrame:
        """Return one row per participant: answers and scores of the questionnaires."""
        return pd.DataFrame([dict(i.person) for i in self._intakes])

    def analysis(self, *, peek: str | None = None, **limits: Any) -> StudyAnalysis:
        """Return the analysis: what counts, cell means, an answer to each planned comparison.

        `limits` replace those of the study's exclusion rules, thresholds, and how trials are
        measured where that can be set. `peek` is why results of a blinded
        study are looked at before it is complete, which is recorded.

        Raises:
            UsageError: the study's locked plan hides results for now.
            DataError: there is no such rule, or no trial counts.
        """
        manifests = [s.recording.manifest for s in self.sessions]
        check_interim_analysis(
            self.path,
            read_lock(self.path),
            manifests,
            SystemClock(),
            is_requested=peek is not None,
            reason=peek or "",
        )
        self.study.check_settings(limits)
        pieces = self.study.pieces
        of_measuring = (SETTING, *(() if pieces is None else pieces.settable))
        how = {k: v for k, v in limits.items() if k in of_measuring}
        return self.study.analysis_of(self._taken_in(how) if how else self._intakes, limits)


def open_study(path: str | Path, *, accept_damage: bool = False) -> StudyData:
    """Open the data of a study: the folder that holds `sub-…/ses-…`.

    Measuring a damaged recording raises DataError, unless `accept_damage` is set.

    Raises:
        UsageError: there are no sessions, or the study's file is gone.
    """
    folder = Path(path).resolve()
    first = Recording(sessions_of(folder)[0])
    use_recorded_cast(first)
    study, _ = study_of_folder(folder, first.manifest.study)
    return StudyData(folder, study, accept_damage)


def simulate(
    study: str | Path,
    participants: int = 12,
    *,
    output: str | Path,
    seed: int = DEFAULT_SEED,
    effect: bool = True,
    parameters: Mapping[str, Any] | None = None,
    config: str | Path | None = None,
    processes: int | None = None,
) -> StudyData:
    """Simulate a study (its name, or its file) on the virtual clock; sessions there are kept.

    Raises:
        UsageError: there is no such study, or the folder was begun with other settings.
        ConfigError: a parameter does not exist.
    """
    lab = _lab(config)
    opened_study = find_study(str(study), lab.studies)
    root = Path(output).resolve()
    folder = root / SIMULATED_ROOT / opened_study.name
    usual = wanted_settings(folder, opened_study, is_simulated=True, seed=seed, effect=effect)
    settings = StudySettings(
        usual.study,
        usual.seed,
        True,
        effect,
        dict(parameters or usual.parameters),
        source=usual.source,
        source_sha256=usual.source_sha256,
    )
    data_folder = simulate_study(
        lab, opened_study, settings, participants, root, processes=processes, notifier=NOTIFIER
    )
    return StudyData(data_folder, opened_study)


def analyse(
    data: StudyData | str | Path,
    *,
    output: str | Path | None = None,
    processes: int | None = None,
    peek: str | None = None,
) -> Path:
    """Write tables, figures and the report of a study; return the report's path.

    `peek` is why results of a blinded study are looked at before it is complete.
    """
    folder = data.path if isinstance(data, StudyData) else Path(data)
    return analyse_study(
        folder,
        None if output is None else Path(output),
        processes=processes,
        peek=peek,
        notifier=NOTIFIER,
    )


def tables(data: StudyData | str | Path) -> dict[str, pd.DataFrame]:
    """Return the tables that `analyse` has written, by name.

    Raises:
        UsageError: nothing has been analysed there yet.
    """
    folder = (data.path if isinstance(data, StudyData) else Path(data)) / DERIVED_FOLDER
    frames = {
        p.stem: pd.read_csv(p, dtype={"participant": str}) for p in sorted(folder.glob("*.csv"))
    }
    if not frames:
        raise UsageError(f"{folder} holds no tables; make them: visavis.analyse({str(data)!r})")
    return frames


def _lab(config: str | Path | None) -> LabConfig:
    path = Path(config) if config is not None else find_config(Path.cwd())
    if path is None:
        lab = parse_config(EXAMPLE.read_text("utf-8"), EXAMPLE, OPTION_MODELS, folder=Path.cwd())
    elif path.exists():
        lab = load_config(path, OPTION_MODELS)
    else:
        raise ConfigError(
            f"there is no {CONFIG_NAME} at {path}; write one with visavis init, or leave config out"
        )
    return with_devices(lab, "sim")
