"""A study as the command line and scripts use it: made, performed, measured, analysed."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from visavis.analysis.report.sources import provenance_of_sessions
from visavis.lab.config import LabConfig
from visavis.lab.errors import ConfigError, DataError
from visavis.lab.garbage import collecting_seldom
from visavis.lab.yaml_lines import did_you_mean, names_or_none
from visavis.people.person import StudyPerson
from visavis.protocol.people.simulated_participant import SimulatedParticipant
from visavis.protocol.plan.experiment import ValidationPoint, ValidationVerdict
from visavis.protocol.plan.questionnaires import Questionnaire
from visavis.protocol.plan.shown_scene import RecordedScene
from visavis.recording.reader import Recording
from visavis.results.analysis import (
    AnalysisInForce,
    StudyAnalysis,
    analyse_rows,
    measures_of,
)
from visavis.results.coding import ANNOTATIONS
from visavis.results.family_tests import DEFAULT_TEST_RULES, TestRules
from visavis.results.flat_again import flat_views, read_items_text
from visavis.results.gaze_order import FIXATIONS, with_fixations
from visavis.results.intake import (
    SessionIntake,
    questionnaire,
    take_in,
    with_coding,
    with_remarks,
)
from visavis.results.locked_plan.review import PlanReview
from visavis.results.names_in_use import (
    refuse_impossible_tests,
    refuse_unknown_levels,
    refuse_unknown_names,
)
from visavis.results.picture_delay import SETTING, delay_of
from visavis.results.reevaluation import pair_by_own_time
from visavis.results.selection import Selection, left_out_lines, select
from visavis.results.several_sessions import (
    people_of,
    planned_counts_of,
    with_session_names,
)
from visavis.results.study_names import refuse_unusable_names
from visavis.results.tables.dictionary import PEOPLE, trial_columns
from visavis.results.time_course import TIME_COURSE, with_time_course
from visavis.results.validation import judge_validation
from visavis.stimuli.area_paths import FilesGone
from visavis.stimuli.areas import rooms_in
from visavis.stimuli.moving_heads import HEADS_MOVE, moving_heads
from visavis.stimuli.own_room import PlacedRoom
from visavis.stimuli.room_shape import shape_of
from visavis.stimuli.scene import SceneFrame
from visavis.study.cast import use_recorded_cast
from visavis.study.catalogue import declared_study
from visavis.study.declaration import Study
from visavis.study.exclusions import ANSWERED_COLUMN, STANDARD_COLUMNS, limits_in_force
from visavis.study.experiment import StudyExperiment
from visavis.study.live import Slider
from visavis.study.measures import Measure, lost_gaze, lost_head
from visavis.study.moulding import FIGURE_ON, FIGURE_TURNED, SLIDER_MOVED, stage_again
from visavis.study.moulding import SCENE as LIVE_SCENE
from visavis.study.pieces import MeasuredTrial, Pieces
from visavis.study.scenes import FLAT, PAIR, ROOM, Scene, StagedScene, Staging, stage
from visavis.study.sections import TrialToSee
from visavis.study.study_errors import line_saying
from visavis.study.texts import label_of

HEADS_AT_ONSET: Final = (
    "gaze on people who moved was measured where their heads were at the onset, as versions before "
    "did, not where they were at the time of each sample"
)


@dataclass(frozen=True, eq=False)
class OpenedStudy:
    """What every command asks of a study declared on the kit."""

    study: Study
    plan: PlanReview | None = None
    """How its locked plan was followed, for the report; None where no plan was locked."""
    tell: Callable[[str], None] | None = None
    """Called with a line on every trial and person that an analysis leaves out, and why."""
    make_views: Callable[[Path, Sequence[TrialToSee]], None] | None = None
    """Makes the pages of trials to look at, in the folder of the report."""

    @property
    def name(self) -> str:
        """The study's name on the command line."""
        return self.study.name

    @property
    def title(self) -> str:
        """The study's name in a heading."""
        return self.study.title

    def experiment(
        self, overrides: Mapping[str, Any], *, is_recorded: bool = False
    ) -> StudyExperiment:
        """Return the experiment; `overrides` replace parameters by name.

        What `is_recorded` has what was measured, and areas of interest, in the recording: files of
        pictures, films and areas may be gone.

        Raises:
            ConfigError: a parameter, a value or a text does not exist.
            DesignError: a trial cannot be run through.
        """
        files_gone = FilesGone() if is_recorded else None
        experiment = StudyExperiment(self.study, dict(overrides), files_gone=files_gone)
        refuse_unknown_names(experiment, self.measures(experiment))
        refuse_unknown_levels(experiment)
        return experiment

    def experiment_to_run(self, overrides: Mapping[str, Any]) -> StudyExperiment:
        """Return the experiment, as `experiment`, for what is yet to be recorded.

        Raises:
            ConfigError: as `experiment`, or a questionnaire cannot be read.
            DesignError: a trial cannot be run through, or the study has a name with which it could
                not be performed or not be analysed.
        """
        experiment = self.experiment(overrides)
        refuse_impossible_tests(experiment)
        refuse_unusable_names(experiment, self.measures(experiment))
        return experiment

    def experiment_of(self, recording: Recording) -> StudyExperiment:
        """Return the experiment with the parameters that a session was recorded with.

        Raises:
            DataError: its study no longer has one of them, or refuses its value.
        """
        try:
            experiment = self.experiment(overrides_of(recording.manifest.plan), is_recorded=True)
            return experiment.of_session(recording.manifest.session)
        except ConfigError as error:
            raise DataError(
                f"{recording.path} was recorded with parameters that its study does not have now "
                f"({error}); analyse it with the version of Visavis that its manifest.json names "
                "under provenance, or move its folder out of the study"
            ) from error

    def _refuse_absent(
        self, experiment: StudyExperiment, rows: pd.DataFrame, facts: pd.DataFrame | None
    ) -> None:
        """Refuse a rule of exclusion whose column neither the study nor these data have.

        Raises:
            DataError: with the line of the study file and the most similar valid name.
        """
        own: list[str] = [] if facts is None else list(map(str, facts))
        there = {"trial": list(map(str, rows)), "participant": own}
        dictionary = {
            "trial": trial_columns(experiment, self.measures(experiment)),
            "participant": {c.name for c in PEOPLE},
        }
        for rule in self.study.analysis.exclusions:
            valid_names = {*there[rule.level], *dictionary[rule.level], *STANDARD_COLUMNS}
            if rule.column not in valid_names:
                place = line_saying(self.study.files.path, rule.column) or f"study {self.name}"
                raise DataError(
                    f"{place}: no {rule.level} has {rule.column!r}"
                    f"{did_you_mean(rule.column, valid_names)}"
                )

    def participant(
        self, index: int, seed: int, *, effect: bool, experiment: Any = None
    ) -> SimulatedParticipant:
        """Return a simulated participant, who gets the same information as a real one."""
        study_experiment = self.experiment({}) if experiment is None else experiment
        if self.study.simulated.person_of is not None:
            return self.study.simulated.person_of(index, seed, effect, study_experiment)
        if self.study.simulated.scaled_of is not None:
            return self.study.simulated.scaled_of(index, seed, float(effect), study_experiment)
        return StudyPerson(
            index,
            seed,
            effect,
            responses=study_experiment.words,
            answer_of=self.study.simulated.answer_of,
            visit=study_experiment.session if study_experiment.session_name else 1,
        )

    def judge_validation(
        self, points: Sequence[ValidationPoint], rate_hz: float
    ) -> ValidationVerdict:
        """Measure a validation per eye; the combined eye decides. Passes where gaze is not used."""
        if not self.study.devices.validate:
            return ValidationVerdict(
                True, "gaze is not measured in this study", None, None, None, 0, ()
            )
        return judge_validation(points, rate_hz)

    def questionnaires(self, config: LabConfig) -> tuple[Questionnaire, ...]:
        """Return the questionnaires asked after blocks and at the end, in the lab's wording."""
        return tuple(
            questionnaire(n, self.study.folders, config.wording.get(n), language=config.language)
            for n in (*self.study.asks.after_block, *self.study.asks.questionnaires)
        )

    def views_of(self, record: RecordedScene) -> Iterator[SceneFrame]:
        """Yield the views that a recorded frame may have shown, the likeliest first."""
        if self.study.procedure.views_of is not None:
            yield from self.study.procedure.views_of(record, self._experiment_at(record))
            return
        bare = record.view
        figure = record.latest(FIGURE_ON)
        if figure is not None and record.scene.name == LIVE_SCENE:
            yield self._moulded(record, figure[1])
            return
        if record.scene.name == FLAT:
            views = list(flat_views(record, self.study.files.trial_folder))
            if views:
                yield from views
                return
        payload = record.with_onset("shown")
        if payload is None and (latest := record.latest("shown")) is not None:
            payload = latest[1]
        if payload is None or not (record.scene.agents or record.scene.name == ROOM):
            yield replace(
                bare, scene=replace(bare.scene, dressed_by=self.study.procedure.dressed_by)
            )
            return
        staged_scene = self._staged_again(payload)
        _require_same_room(record, payload, staged_scene.scene.room)
        scene = replace(
            staged_scene.scene, agents=record.scene.agents, brightness_01=record.scene.brightness_01
        )
        yield replace(bare, scene=scene)

    def _experiment_at(self, record: RecordedScene) -> StudyExperiment:
        """Return the experiment of a recorded frame, made once for its recording."""
        overrides = overrides_of(record.recording.manifest.plan)
        return record.once("experiment", lambda: self.experiment(overrides, is_recorded=True))

    def _staged_again(self, payload: Mapping[str, Any]) -> StagedScene:
        """Return a scene as an event "shown" describes it."""
        options = {
            k.removeprefix("option_"): v for k, v in payload.items() if k.startswith("option_")
        }
        if "room" in options:
            (options["room"],) = read_items_text(f"({options['room']},)")
        staging = Staging(
            np.random.default_rng(0), 0.0, int(payload["start_ns"]), self.study.files.trial_folder
        )
        return stage(Scene(payload["scene"], **options), staging, self.study.procedure.makers)

    def took_heads_at_onset(self, recording: Recording, part: int) -> bool:
        """Tell whether people moved in a part, and gaze was measured on their heads where they were
        at the onset, as older versions did.
        """
        scenes = recording.events_named("scene", part)
        still_ns = {
            int(t_ns)
            for t_ns, about in zip(scenes["t_ns"], scenes["payload"], strict=True)
            if about["agents"] and HEADS_MOVE not in about
        }
        payloads = recording.events_named("shown", part)["payload"]
        shown_scenes = {
            str({k: v for k, v in p.items() if k == "scene" or k.startswith("option_")}): p
            for p in payloads
            if p.get("start_ns") in still_ns and p["scene"] != PAIR
        }
        return any(
            moving_heads(self._staged_again(p).scene) is not None for p in shown_scenes.values()
        )

    def _moulded(self, record: RecordedScene, description: Mapping[str, Any]) -> SceneFrame:
        """Return a figure that was moulded as it stood in a frame."""
        experiment, trial = self._experiment_at(record), record.trial()
        lives = record.once(("lives", trial.trial_id), lambda: experiment.lives_of(trial))
        sliders = {r.name: r for r in experiment.responses.values() if isinstance(r, Slider)}
        changes = [
            change
            for name in (SLIDER_MOVED, FIGURE_TURNED)
            for change in record.since(name)
            if change["figure"] == description["figure"]
        ]
        again = stage_again(lives[description["figure"]], sliders, description, changes)
        return again.frame(record.t_ns)

    # ---- analysis ----

    def measures(self, experiment: StudyExperiment) -> tuple[Measure, ...]:
        """Return all measures, with the share of lost gaze, or of lost head where gaze is not used.

        Measures of looks already contain the share of lost gaze.
        """
        measures = measures_of(self.study, experiment.responses)
        if self.study.analysis.looks:
            return measures
        of_gaze = [m.scene or "scene" for m in measures if m.needs_gaze]
        loss_measure = lost_gaze(of_gaze[0]) if of_gaze else lost_head()
        return (
            measures
            if loss_measure.column in {m.column for m in measures}
            else (*measures, loss_measure)
        )

    @property
    def pieces(self) -> Pieces | None:
        """How its trials are measured one by one; None where a session is measured at once."""
        return self.study.analysis.measured_in_pieces

    def original_questionnaires(self, names: Sequence[str]) -> list[Questionnaire]:
        """Return questionnaires by name, in their original wording."""
        return [questionnaire(name, self.study.folders) for name in names]

    def measure(
        self,
        recording: Recording,
        settings: Mapping[str, Any] | None = None,
        trial_measures: Mapping[str, MeasuredTrial] | None = None,
    ) -> SessionIntake:
        """Take in one session; `trial_measures` are those of trials that were measured before."""
        use_recorded_cast(recording)
        study, pieces = self.study, self.pieces
        experiment = self.experiment_of(recording)
        pair_by_own_time(recording, self.views_of)
        intake = take_in(
            recording,
            self.measures(experiment),
            self.original_questionnaires(study.asks.questionnaires),
            study.analysis.looks,
            self.original_questionnaires(study.asks.after_block),
            study.design.blocked_by,
            () if pieces is None else None,
            answers=tuple(experiment.responses),
            picture_delay_ms=delay_of(settings or {}),
        )
        parts = [part.number for part in recording.manifest.parts]
        if any(self.took_heads_at_onset(recording, part) for part in parts):
            words = (*filter(None, [intake.facts.get("latency")]), HEADS_AT_ONSET)
            intake = replace(intake, facts={**intake.facts, "latency": "; ".join(words)})
        intake = with_coding(with_remarks(intake, recording), recording)
        intake = with_session_names(intake, study.design.sessions)
        if pieces is None:
            return intake
        how = pieces.how_with(settings or {})
        measured_trials = (
            pieces.measure_all(recording, how) if trial_measures is None else trial_measures
        )
        factors = [f.name for f in study.design.factors]
        rows, tables = pieces.put_together(recording, intake.rows, measured_trials, factors, how)
        return replace(intake, rows=rows, tables=tables)

    def check_settings(self, settings: Mapping[str, Any]) -> None:
        """Refuse settings of the analysis that do not exist, before anything is measured.

        Raises:
            DataError: there is no such rule or threshold.
            UsageError: one is out of range.
            ConfigError: a value has the wrong type.
        """
        study, pieces = self.study, self.pieces
        setting_names = [SETTING, *(r.name for r in study.analysis.exclusions)]
        if study.analysis.families:
            setting_names += [f.name for f in fields(TestRules)]
        elif study.analysis.compare:
            setting_names += ["alpha", "normality_alpha"]
        thresholds = study.analysis.thresholds
        setting_names += [] if thresholds is None else [f.name for f in fields(thresholds)]
        setting_names += [] if pieces is None else pieces.settable
        unknown = set(settings) - set(setting_names)
        if unknown:
            raise DataError(
                f"{self.name} has no rule {', '.join(sorted(unknown))}; its rules are "
                f"{names_or_none(setting_names)}"
            )
        delay_of(settings)
        limits_in_force(study.analysis.exclusions, settings)
        DEFAULT_TEST_RULES.with_settings(settings)
        study.thresholds_with(settings)
        _ = pieces is None or pieces.how_with(settings)

    @collecting_seldom()
    def analysis_of(
        self, sessions: Sequence[SessionIntake], settings: Mapping[str, Any] | None = None
    ) -> StudyAnalysis:
        """Analyse sessions that were taken in.

        `settings` replace limits of exclusion rules, thresholds of tests (`TestRules`) and of
        the study's own analysis.

        Raises:
            DataError: there is no such rule or threshold, or no trial counts.
            UsageError: one is out of range.
        """
        settings = settings or {}
        self.check_settings(settings)
        experiment = self.experiment(overrides_of(sessions[0].manifest.plan), is_recorded=True)
        rows = pd.concat([s.rows for s in sessions], ignore_index=True)
        facts_of = self.study.analysis.facts_of
        self._refuse_absent(experiment, rows, None if facts_of is None else facts_of(rows))
        return self.analysis_of_rows(
            experiment,
            rows,
            pd.DataFrame(people_of(sessions, self.study.design.sessions)),
            planned_counts=planned_counts_of(sessions),
            settings=settings,
            sensitivity_rows=pd.concat([s.sensitivity for s in sessions], ignore_index=True),
            tables=self._tables(sessions),
        )

    def _tables(self, sessions: Sequence[SessionIntake]) -> dict[str, pd.DataFrame]:
        """Return the further tables of all sessions: answers after blocks, looks over time and in
        order, what was coded, and the study's own.
        """
        every = [
            {
                "blocks": s.blocks,
                TIME_COURSE: s.course,
                FIXATIONS: s.fixations,
                ANNOTATIONS: s.coding,
                **s.tables,
            }
            for s in sessions
        ]
        tables = {
            name: pd.concat([t[name] for t in every], ignore_index=True)
            for name in dict.fromkeys(name for t in every for name in t)
        }
        optional = ("blocks", TIME_COURSE, FIXATIONS, ANNOTATIONS)
        return {name: t for name, t in tables.items() if len(t.columns) or name not in optional}

    def analysis_of_rows(
        self,
        experiment: StudyExperiment,
        rows: pd.DataFrame,
        people: pd.DataFrame,
        *,
        planned_counts: Mapping[str, int],
        settings: Mapping[str, Any] | None = None,
        sensitivity_rows: pd.DataFrame | None = None,
        tables: Mapping[str, pd.DataFrame] | None = None,
    ) -> StudyAnalysis:
        """Analyse trials, one row each; `people` hold answers of questionnaires.

        `planned_counts` are the numbers of trials planned for each participant. `sensitivity_rows`
        are the main measures of looks by padding and minimum duration, `tables` the study's further
        tables.

        Raises:
            DataError: no trial counts.
        """
        design = self.study.design_with(experiment.parameters)
        cell_factors = self.study.analysis.cells_of(design)
        settings = settings or {}
        selection = self.selection_of(
            experiment, rows, planned_counts=planned_counts, settings=settings, people=people
        )
        pieces = self.pieces
        in_force = AnalysisInForce(
            levels=experiment.levels,
            measures=self.measures(experiment),
            cells=[f.name for f in (*design.between, *cell_factors)],
            compare=[c.with_alphas(settings) for c in experiment.compare],
            rules=DEFAULT_TEST_RULES.with_settings(settings),
            thresholds=self.study.thresholds_with(settings),
            how=None if pieces is None else pieces.how_with(settings),
            level_words={
                str(level): label_of(experiment.texts, str(level))
                for levels in experiment.levels.values()
                for level in levels
            },
        )
        return analyse_rows(
            self.study,
            selection,
            people,
            in_force,
            is_simulated=bool(rows["is_simulated"].any()),
            sensitivity_rows=sensitivity_rows,
            tables=with_fixations(
                with_time_course(tables or {}, selection, in_force.cells),
                selection,
                in_force.cells,
            ),
        )

    def selection_of(
        self,
        experiment: StudyExperiment,
        rows: pd.DataFrame,
        *,
        planned_counts: Mapping[str, int],
        settings: Mapping[str, Any] | None = None,
        people: pd.DataFrame | None = None,
    ) -> Selection:
        """Decide by the study's rules which trials count; `people` hold what they answered."""
        rules, facts_of = self.study.analysis.exclusions, self.study.analysis.facts_of
        design = self.study.design_with(experiment.parameters)
        # Who did not come to a session still counts where sessions are not compared.
        cell_factors = [
            f for f in self.study.analysis.cells_of(design) if f != design.session_factor
        ]
        return select(
            rows,
            rules,
            limits_in_force(rules, settings or {}),
            cells=[f.name for f in cell_factors],
            planned_counts=planned_counts,
            cell_count=int(np.prod([len(f.levels) for f in cell_factors])),
            facts=_facts(None if facts_of is None else facts_of(rows), people),
        )

    def analyse(
        self,
        sessions: Sequence[SessionIntake],
        out_dir: Path,
        *,
        is_simulated: bool,
        commands: tuple[str, ...],
        example: Recording | None,
        settings: Mapping[str, Any] | None = None,
        folder: str = "",
    ) -> Path:
        """Write tables, figures and the report of a study; return the report's path."""
        analysis = self.analysis_of(sessions, settings)
        return self.write(
            analysis,
            sessions,
            out_dir,
            is_simulated=is_simulated,
            commands=commands,
            example=example,
            folder=folder,
        )

    @collecting_seldom()
    def write(
        self,
        analysis: StudyAnalysis,
        sessions: Sequence[SessionIntake],
        out_dir: Path,
        *,
        is_simulated: bool,
        commands: tuple[str, ...],
        example: Recording | None,
        folder: str = "",
    ) -> Path:
        """Write tables, figures and the report of what was analysed; return the report's path.

        `folder` is the study's folder as the report names it. The tables of `sessions` are not
        used.
        """
        # Imported here: figures take a second to import, and sessions and previews need none.
        from visavis.results.outputs import write_study

        remarks = tuple(r for one in sessions for r in one.remarks)
        analysis = replace(analysis, is_simulated=is_simulated, example=example, remarks=remarks)
        for line in left_out_lines(analysis.selection, self.study.analysis.exclusions):
            if self.tell is not None:
                self.tell(line)
        provenance = provenance_of_sessions(
            self.name,
            [s.manifest for s in sessions],
            [s.source for s in sessions],
            commands,
            folder,
        )
        experiment = self.experiment(overrides_of(sessions[0].manifest.plan), is_recorded=True)
        questionnaires = self.original_questionnaires(self.study.asks.questionnaires)
        facts = {**sessions[0].facts, **self.study.report.setup}
        return write_study(
            analysis,
            experiment,
            questionnaires,
            provenance,
            out_dir,
            facts,
            self.plan,
            [stream for s in sessions for stream in s.streams],
            self.make_views,
        )


def _facts(own: pd.DataFrame | None, people: pd.DataFrame | None) -> pd.DataFrame | None:
    """Return facts about people that do not follow from their trials, the study's own included."""
    if people is None or ANSWERED_COLUMN not in people:
        return own
    answer_shares = people[["participant", ANSWERED_COLUMN]]
    return answer_shares if own is None else answer_shares.merge(own, on="participant", how="outer")


def overrides_of(plan: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters that a recorded plan was made with, as the plan names them."""
    overrides = {}
    for name, value in plan.get("parameters", {}).items():
        is_list = isinstance(value, str) and value.startswith("[")
        overrides[name] = json.loads(value) if is_list else value
    return overrides


def find_study(reference: str, of_lab: Mapping[str, Path] | None = None) -> OpenedStudy:
    """Return a study by its file's path, or by name; `of_lab` are the lab's own by name.

    Raises:
        UsageError: there is none, with the nearest name.
        DesignError: the file cannot be read, or declares no study.
    """
    return OpenedStudy(declared_study(reference, of_lab))


def _require_same_room(
    record: RecordedScene, payload: Mapping[str, Any], room: PlacedRoom | None
) -> None:
    """Refuse to draw a room from a file that is no longer the one that was shown.

    Raises:
        DataError: it is another.
    """
    if room is None:
        return
    sha256 = shape_of(room).sha256
    if {sha256} != rooms_in(str(payload.get("areas", "[]"))):
        raise DataError(
            f"{room.path} is not the room that {record.recording.path} showed (SHA-256 {sha256}); "
            "put the former file back to draw it again"
        )
