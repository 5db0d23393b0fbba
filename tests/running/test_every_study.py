"""What must hold of every study, shipped or found: plans, people, texts, tables, pictures."""

import json
import os
import re
import shutil
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.faults.sessions import CONFIG, TIMING, lab
from tests.store import STORE
from visavis.cli.preview.pictures import Viewpoint, camera_of
from visavis.cli.quick_tracker import tracker_of
from visavis.cli.viewer import content as viewer
from visavis.cli.viewer.bundle import Bundle
from visavis.lab.config import LabConfig, load_config
from visavis.lab.geometry import Pose
from visavis.protocol.session.operator import SessionStatus, UnattendedOperator
from visavis.protocol.session.states import SessionState
from visavis.recording.cached import CachedRecording
from visavis.recording.folder import session_dir
from visavis.recording.reader import Recording
from visavis.results.analysis import answer_comparison, columns_of
from visavis.results.family_tests import results_of
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.results.selection import IS_ANALYSED
from visavis.running.quick import quick_rows, quick_study
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.running.sessions.session_request import Request, simulated_request
from visavis.running.study_check import (
    first_view,
    languages_of,
    performing_problems,
    plan_problems,
    rename_levels,
    renamed_parameters,
    text_problems,
)
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, Renderer
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.study.catalogue import SHIPPED_STUDIES
from visavis.study.experiment import StudyExperiment
from visavis.study.information import (
    ARMBAND,
    STREAM_FACTS,
    facts_in_event,
    facts_in_lab_event,
    information_at_devices,
    information_on_page,
)
from visavis.study.live import Slider

STUDIES = Path(__file__).parents[1] / "studies"
FOUND = tuple(str(path) for path in sorted(STUDIES.glob("*.py")))
EVERY = (*SHIPPED_STUDIES, *FOUND)
SEED = 1
PEOPLE = 3
FOR_NULL = 12
NULL_ALPHA = 0.001
"""What nothing may fall below: how often the errors come is counted by power and null runs."""
SMALL: dict[str, dict[str, Any]] = {
    "stare": {
        "trial_s": 1.0, "practice_s": 1.0, "intertrial_s": 0.2, "repetitions": 1, "blocks": 1,
        "zone": ["left", "right"], "depth": ["close"],
    },
    "crowd": {"configuration": [1], "intertrial_s": 0.5, "limit_s": 3.0},
    "waving": {
        "clerk": ["clerk_left"], "participant_place": ["place_3"], "increment": 0.1,
        "before_s": 0.3, "wave_s": 0.6, "after_s": 0.1, "intertrial_s": 0.1, "blocks": 1,
    },
    "waving_page": {
        "clerk": ["clerk_left"], "participant_place": ["place_3"], "increment": 0.1,
        "before_s": 0.3, "wave_s": 0.6, "after_s": 0.1, "intertrial_s": 0.1, "blocks": 1,
    },
    "adjectives": {"emotion": ["depression", "pleasure"]},
    "duel": {"repetitions": 1, "practice": 1},
    "moulding_lab": {"beside_s": 5},
}  # fmt: skip
"""Parameters that make a study short."""
SHORT_COUNTS: dict[str, dict[str, Any]] = {"crowd": {"came_back": None, "surface": "capsules"}}
"""Settings of the analysis with which short trials count, and are measured quickly."""
FOR_NULL_SET: dict[str, dict[str, Any]] = {"crowd": {"configuration": [1]}}
"""Parameters of the null run where short trials hold nothing to compare."""
TINY_PX = (96, 60)


def name_of(reference: str) -> str:
    """Return a study's name from what finds it."""
    return Path(reference).stem


@cache
def found(reference: str) -> OpenedStudy:
    """Return a study."""
    return find_study(reference)


def small(reference: str) -> dict[str, Any]:
    """Return the parameters of a short run."""
    return SMALL.get(name_of(reference), {})


def on_kit(reference: str) -> OpenedStudy:
    """Return a study; all of them are declared on the kit."""
    study = found(reference)
    assert isinstance(study, OpenedStudy)
    return study


def config_for(study: OpenedStudy, root: Path) -> LabConfig:
    """Return the example laboratory at low rates, with the devices that a study cannot miss."""
    config = lab(root)
    example = load_config(CONFIG)
    needed = [r for r in study.experiment({}).needed_roles if r not in config.devices]
    return config.model_copy(
        update={"devices": {**config.devices, **{r: example.devices[r] for r in needed}}}
    )


def request_for(
    study: OpenedStudy, reference: str, root: Path, index: int, set_to: dict[str, Any] | None = None
) -> Request:
    """Return a short session of one simulated person; `set_to` replaces the usual parameters."""
    parameters = small(reference) if set_to is None else set_to
    experiment = study.experiment(parameters)
    made = simulated_request(
        study,
        experiment,
        config_for(study, root),
        label=f"S{index + 1:02d}",
        index=index,
        seed=SEED,
        group=experiment.plan(index, SEED).group,
    )
    return replace(made, timing=TIMING)


def recorded(study: OpenedStudy, reference: str, root: Path, index: int) -> Path:
    """Return the short session of one simulated person, shared with other tests."""
    return STORE.copy(
        f"short {name_of(reference)} {index}",
        lambda at: perform_new(request_for(study, reference, at, index)),
        root,
    )


@pytest.mark.parametrize("reference", EVERY, ids=name_of)
def test_plan_is_the_same_whenever_it_is_made(reference: str) -> None:
    made = found(reference).experiment(small(reference))
    again = found(reference).experiment(small(reference))
    for index in range(PEOPLE):
        assert made.plan(index, SEED) == again.plan(index, SEED)
    assert made.plan(0, SEED) != made.plan(1, SEED)


@pytest.mark.parametrize("reference", EVERY, ids=name_of)
def test_every_person_meets_every_condition_equally_often(reference: str) -> None:
    experiment = on_kit(reference).experiment({})
    assert [] == plan_problems(experiment)


@pytest.mark.parametrize("reference", EVERY, ids=name_of)
def test_texts_agree_between_languages_and_name_no_number_themselves(reference: str) -> None:
    assert [] == text_problems(on_kit(reference).study)


@pytest.mark.parametrize("reference", EVERY, ids=name_of)
def test_columns_are_described_and_people_are_not_told_conditions(reference: str) -> None:
    study = on_kit(reference)
    assert [] == performing_problems(study, study.experiment(small(reference)))


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    try:
        opened = Renderer(quality=LIGHTEST)
    except StageError as problem:
        pytest.skip(str(problem))
    with opened:
        yield opened


@pytest.mark.parametrize("reference", EVERY, ids=name_of)
def test_every_condition_can_be_drawn_and_shows_something(
    reference: str, renderer: Renderer
) -> None:
    experiment = on_kit(reference).experiment(small(reference))
    head = Pose(np.array([0.0, 1.2, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    drawn: set[int] = set()
    for key, read in experiment.read.items():
        crowd = None if read.lit_frame is None else getattr(read.lit_frame.scene, "crowd", None)
        views = [] if read.lit_frame is None or id(crowd) in drawn else [read.lit_frame]
        drawn |= set() if crowd is None else {id(crowd)}  # the same crowd in every block
        for wanted in read.scenes:
            view = first_view(experiment, wanted)
            assert view is not None, key
            views.append(view)
        for view in views:
            picture = picture_of(view)
            camera = camera_of(Viewpoint.EYES, picture, head, TINY_PX[0] / TINY_PX[1], passed_s=0)
            image = renderer.image(picture, camera, TINY_PX)
            assert image.std() > 5, f"{dict(key)} is one plain colour"


@dataclass
class Killing(UnattendedOperator):
    """Kill the process in the middle of a trial, as a power cut would."""

    trial_number: int = 2
    status_period_ns: int = 1

    def __post_init__(self) -> None:
        self._seen: list[str] = []

    def show(self, status: SessionStatus) -> None:
        """Look for the trial."""
        if status.state is not SessionState.TRIAL:
            return
        if status.trial_id not in self._seen:
            self._seen.append(status.trial_id)
        elif len(self._seen) == self.trial_number:
            os.kill(os.getpid(), signal.SIGKILL)


MEANS = "mean over participants (SD)"


def killed(request: Request) -> bool:
    """Perform a session in a process of its own that is killed; tell whether it was."""
    pid = os.fork()
    if pid == 0:
        try:
            perform_new(replace(request, operator=Killing()))
        finally:
            os._exit(1)
    return os.WIFSIGNALED(os.waitpid(pid, 0)[1])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork a process")
@pytest.mark.timeout(900)
@pytest.mark.parametrize("reference", EVERY, ids=name_of)
def test_three_people_one_killed_and_resumed_are_analysed(reference: str, tmp_path: Path) -> None:
    study = on_kit(reference)
    paths = [recorded(study, reference, tmp_path, i) for i in range(PEOPLE - 1)]
    last = request_for(study, reference, tmp_path, PEOPLE - 1)
    assert killed(last)
    path = session_dir(tmp_path, study.name, last.person.label, 1, is_simulated=True)
    paths.append(perform_rest(last, path))
    settings = SHORT_COUNTS.get(study.name, {})
    sessions = [study.measure(Recording(p), settings) for p in paths]
    rows = pd.concat([s.rows for s in sessions])
    done = rows[rows["status"] == "complete"]
    experiment = study.experiment(small(reference))
    planned = sum(len(experiment.plan(i, SEED).trials) for i in range(PEOPLE))
    assert planned == len(done) == len(done.groupby(["participant", "trial_id"]))
    assert [1, 1, 2] == [len(s.manifest.parts) for s in sessions]
    report = study.analyse(
        sessions,
        tmp_path / "derived",
        is_simulated=True,
        commands=(),
        example=None,
        settings=settings,
    )
    said = report.read_text(encoding="utf-8")
    assert "SIMULATED" in said
    means = [part for part in said.split('<div class="table">')[1:] if MEANS in part]
    assert all(re.search(r">[1-9]\d*</td></tr>", part) for part in means)  # nobody has no mean
    trials = pd.read_csv(tmp_path / "derived" / "trials.csv")
    assert 0 < trials[IS_ANALYSED].sum() <= (~trials["is_practice"]).sum()
    assert not trials.loc[trials["is_practice"], IS_ANALYSED].any()
    assert (trials[IS_ANALYSED] == trials["left_out_because"].isna()).all()


@pytest.mark.parametrize("reference", EVERY, ids=name_of)
def test_people_are_told_in_every_language_of_all_that_a_session_holds(
    reference: str, tmp_path: Path
) -> None:
    study = on_kit(reference)
    session = Recording(recorded(study, reference, tmp_path, 0))
    events = session.events()
    is_on_page = study.study.procedure.on == "browser"
    streams = {s.name for part in session.manifest.parts for s in part.streams}
    kinds = {name.partition(f"_{ARMBAND}")[0] for name in streams}  # each armband has its own
    facts = {STREAM_FACTS[kind] for kind in kinds}
    for name, payload in zip(events["name"], events["payload"], strict=True):
        facts |= facts_in_event(name, payload) if is_on_page else facts_in_lab_event(name)
    for language in languages_of(study.study):
        experiment = study.experiment({**small(reference), "language": language})
        lab_there = config_for(study, tmp_path).model_copy(update={"language": language})
        questionnaires = study.questionnaires(lab_there)
        information = information_on_page if is_on_page else information_at_devices
        told = information(experiment, questionnaires).lines
        titles = {"titles": ", ".join(dict.fromkeys(q.title for q in questionnaires))}
        lines = {fact: experiment.texts.get(f"recorded.{fact}", titles) for fact in facts}
        assert [] == [fact for fact, line in lines.items() if line not in told], language


@pytest.mark.parametrize("reference", EVERY, ids=name_of)
def test_names_of_conditions_change_nothing_that_is_recorded(
    reference: str, tmp_path: Path
) -> None:
    study = on_kit(reference)
    other = OpenedStudy(rename_levels(study.study))

    def streams(session: Path) -> dict[str, str]:
        return {s.name: s.sha256 for s in Recording(session).manifest.parts[0].streams}

    same = renamed_parameters(study.study, small(reference))
    renamed_session = perform_new(request_for(other, reference, tmp_path / "b", 0, same))
    assert streams(recorded(study, reference, tmp_path / "a", 0)) == streams(renamed_session)


NODE = shutil.which("node") or ""
READ_ALL = """
const fs = require('fs');
(0, eval)(fs.readFileSync(process.argv[1], 'utf8') + ';globalThis.unpack = unpacked;');
unpack(fs.readFileSync(0, 'utf8')).then(content => {
  const read = content.header.map(s => s.columns.map(c => content.columns(c.v).map(v => [...v])));
  process.stdout.write(JSON.stringify(read));
});
"""


@pytest.mark.skipif(not NODE, reason="there is no node; apt install nodejs")
@pytest.mark.parametrize("reference", EVERY, ids=name_of)
def test_the_viewers_page_reads_every_column_as_it_was_recorded(
    reference: str, tmp_path: Path
) -> None:
    session = CachedRecording(recorded(on_kit(reference), reference, tmp_path, 0))
    bundle, times = Bundle(), viewer.times_of(session)
    packed = [viewer._stream(session, name, bundle, times, ()) for name in session.stream_names]
    script = Path(viewer.__file__).with_name("data.js")
    done = subprocess.run(
        [NODE, "-e", READ_ALL, str(script)],
        input=bundle.text(packed),
        capture_output=True,
        check=True,
        text=True,
    )
    compared = 0
    for stream, columns in zip(packed, json.loads(done.stdout), strict=True):
        arrays = session.stream_arrays(stream["name"])
        for column, read in zip(stream["columns"], columns, strict=True):
            values = arrays[column["name"]][:: stream["every"]]
            if not values.size or (column["unit"] == "ms" and values.dtype.kind == "i"):
                continue  # times, shown as milliseconds after the row arrived
            wanted = values.reshape(len(values), -1).T.astype(float)
            got = np.array([[np.nan if v is None else v for v in one] for one in read])
            wanted = np.where(np.isfinite(wanted), wanted, np.nan)
            exact = values.dtype.kind in "biu"
            spans = np.ptp(np.nan_to_num(wanted), axis=1, keepdims=True)
            assert np.array_equal(np.isnan(wanted), np.isnan(got)), column["name"]
            off = np.nan_to_num(np.abs(got - wanted))
            assert (off <= (0.0 if exact else 1e-6 + spans / 60_000)).all(), column["name"]
            compared += 1
    is_on_page = on_kit(reference).study.procedure.on == "browser"  # fewer streams
    assert compared > (15 if is_on_page else 20) or not session.stream_names


def without_effect(study: OpenedStudy, experiment: StudyExperiment, people: int) -> pd.DataFrame:
    """Return a study's rows, by the quick path, of people on whom its conditions do nothing.

    Of a study measured trial by trial that path is its own.
    """
    if study.pieces is not None:
        return quick_study(study, experiment, tracker_of, range(people), seed=SEED, effect=0).trials
    quick = [m for m in study.measures(experiment) if m.of is None or m.needs_gaze]
    return pd.concat(
        quick_rows(
            experiment,
            study.participant(index, SEED, effect=False, experiment=experiment),
            tracker_of(SEED, index),
            quick,
            index=index,
            seed=SEED,
        )
        for index in range(people)
    )


@pytest.mark.parametrize("reference", EVERY, ids=name_of)
def test_everybody_answers_in_time_on_the_quick_path(reference: str) -> None:
    study = on_kit(reference)
    experiment = study.experiment(small(reference))
    rows = without_effect(study, experiment, 1)
    # Sliders are moved until a figure is like its target, or the time is over; not each is asked of
    # in every trial.
    sliders = {f"{name}_by" for name, r in experiment.responses.items() if isinstance(r, Slider)}
    ways = {
        w
        for c in rows.columns
        if c.endswith("_by") and not c.endswith("ended_by")
        for w in (rows[c].dropna() if c in sliders else rows[c]).unique()
        if w != "limit" or c not in sliders
    }
    assert ways <= {"ray", "gaze", "keys", "gaze and button", "mouse"}


@pytest.mark.timeout(900)
@pytest.mark.parametrize("reference", EVERY, ids=name_of)
def test_without_an_effect_nothing_is_found(reference: str) -> None:
    study = on_kit(reference)
    experiment = study.experiment(FOR_NULL_SET.get(study.name, small(reference)))
    measures = study.measures(experiment)
    rows = without_effect(study, experiment, FOR_NULL)
    levels = experiment.levels
    known = {m.column: m for m in measures}
    nobody = pd.DataFrame()
    for family in study.study.analysis.families:
        for test in results_of(family, rows, nobody, known, levels):
            assert test.outcome is None or test.outcome.p > NULL_ALPHA, test.sentence()
    # Without an effect equivalence is true, and found.
    # Nobody is asked anything here, so that nobody belongs to a group of people.
    groups = study.study.analysis.groups
    compared = [
        c
        for c in experiment.compare
        if c.dv in rows and c.test != "tost" and set(columns_of(c, groups)) <= set(rows)
    ]
    assert compared or study.study.analysis.families or not experiment.compare
    for compare in compared:
        finding = answer_comparison(compare, rows, known, levels, is_simulated=True)
        # Who sees no difference may vote alike throughout: then there is nothing to estimate.
        is_answered = finding.outcome is not None
        assert is_answered or "no finite estimate" in finding.why_not, finding.why_not
        assert all(term.p > NULL_ALPHA for term in finding.terms), compare.name
