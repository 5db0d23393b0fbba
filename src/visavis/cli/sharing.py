"""What a recording contains when it is shared outside the lab."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from visavis.analysis.blur_loss import loss_table, motion_of
from visavis.lab.config import LabConfig
from visavis.lab.errors import LabError, UsageError
from visavis.protocol.people.key_file import KeyFile
from visavis.protocol.plan.columns import ENGINE_COLUMNS
from visavis.recording.bids_about import DatasetAbout
from visavis.recording.manifest import read_manifest
from visavis.recording.reader import Recording
from visavis.recording.sharing import TIERS, RowRule, SharedRecording, Sharing, TextRule, Tier
from visavis.results.opened_study import OpenedStudy, find_study, overrides_of
from visavis.results.report.methods import own_methods
from visavis.results.tables.dictionary import of_shown, trial_columns
from visavis.running.sessions.recorded_design import design_of_session
from visavis.running.sessions.study_folder import holds_trial, study_of_folder
from visavis.study.experiment import StudyExperiment
from visavis.study.live import RENDERER
from visavis.study.responses import ANSWER_ENDINGS, kind_of

BLURRED_RISK = (
    "The public tier gives everybody the body of one reference person, smooths movements, tells "
    "gaze on heads in coarse steps and leaves out pupils, eye distances and what cannot be "
    "blurred. This is not anonymity: habits of walking, looking and answering are left, and who "
    "has other recordings of a person may know them again (Nair et al. 2023). Publish it only "
    "where the consent form and the ethics board allow it."
)
LOSS_NAME = "public_tier.md"
MIN_NAME = 3
"""Shorter words of a name are found in too many texts."""
PARTICLES = frozenset("van von vom zum zur den der des del dos das ter ten und the bin ibn".split())
"""Words of names that are words of languages, too."""


def shared_recording(
    session: Path, lab: LabConfig, *, tier: str, keep_label: bool
) -> SharedRecording:
    """Return a session as it may leave the lab.

    People bear the pseudonym that the study's salt gives them, unless `keep_label`; simulated
    participants, who are nobody, keep their labels.

    Raises:
        UsageError: there is no such tier.
        LedgerError: the key file with the salt cannot be read.
    """
    matching_tier: Tier | None = next((t for t in TIERS if t == tier), None)
    if matching_tier is None:
        raise UsageError(f"--tier takes {', '.join(TIERS[:-1])} or {TIERS[-1]}, not {tier!r}")
    recording = Recording(session)
    label, study = recording.manifest.participant, recording.manifest.study
    if not keep_label and not recording.is_simulated:
        label = KeyFile(lab.key_root, study, [lab.data_root]).pseudonym(label)
    if matching_tier == "raw":
        return SharedRecording(session, Sharing(label, matching_tier, lambda form, question: False))
    opened_study: OpenedStudy | None = None
    with suppress(LabError):
        opened_study = _study_of(session, study, lab)
    sharing = Sharing(
        label,
        matching_tier,
        _text_rule(opened_study, lab),
        _row_rule(opened_study, recording),
        blurs=matching_tier == "public",
    )
    return SharedRecording(session, sharing)


def names_of_people(recordings: Sequence[SharedRecording], lab: LabConfig) -> tuple[str, ...]:
    """Return labels, names and contacts of the people of studies, which no text may hold.

    Raises:
        LedgerError: a key file is damaged.
    """
    names: list[str] = []
    for recording in recordings:
        label = read_manifest(recording.path).participant
        if recording.sharing.label != label:  # else it is meant to be there
            names.append(label)
        if recording.is_simulated:
            continue
        key_file = KeyFile(lab.key_root, recording.manifest.study, [lab.data_root])
        identity = key_file.identity(label) or {}
        for text in identity.values():
            words = (word.strip(".,;:()") for word in text.split())
            names += [
                text,
                *(w for w in words if w.casefold() not in PARTICLES and not w.isdigit()),
            ]
    return tuple(dict.fromkeys(name for name in names if len(name) >= MIN_NAME))


def withheld_lines(recordings: Sequence[SharedRecording], lab: LabConfig) -> tuple[str, ...]:
    """Return what was withheld as free text or unknown, and what to do about it."""
    lines = []
    for name in sorted({r.manifest.study for r in recordings if r.sharing.tier != "raw"}):
        of_study = [r for r in recordings if r.manifest.study == name]
        try:
            _study_of(of_study[0].path, name, lab)
        except LabError as error:
            lines.append(
                f"the study {name} cannot be read ({error}); answers to its questionnaires, and "
                "what only its file describes, are withheld: name the file under studies in "
                "lab_config.yaml and export again"
            )
        withheld = sorted(set().union(*(r.withheld for r in of_study)))
        if withheld:
            lines.append(
                "withheld, as free text or because nothing says what it is: "
                f"{', '.join(withheld)}; --tier raw has it"
            )
    return tuple(lines)


def losses(recordings: Sequence[SharedRecording], lab: LabConfig) -> pd.DataFrame:
    """Return what each measure of a study loses by the blur of the public tier.

    Who came and left before their first trial has no measure.
    """
    study = _study_of(recordings[0].path, recordings[0].manifest.study, lab)
    before, after, online, motion = [], [], [], []
    for public in (r for r in recordings if holds_trial(r.path)):
        raw = Recording(public.path)
        blurred_recording = SharedRecording(public.path, replace(public.sharing, tier="raw"))
        before.append(_rows(study.measure(raw)))
        after.append(_rows(study.measure(blurred_recording)))
        online.append({*raw.trials().columns})
        motion.append((motion_of(raw), motion_of(blurred_recording)))
    return loss_table(before, after, online, motion)


def _rows(intake: Any) -> pd.DataFrame:
    rows = getattr(intake, "rows", None)
    return pd.DataFrame([w.row for w in intake.walks]) if rows is None else rows


def loss_page(table: pd.DataFrame) -> str:
    """Return the page that goes with data of the public tier: the risk, and what is lost."""
    lines = ["## Public tier", BLURRED_RISK, "Means of the same trials, as recorded and as shown:"]
    head = ["measure", "values", "before", "after", "mean change", "missing after"]
    rows = [head, ["---"] * len(head)]
    rows += [
        [str(r[0]), str(r[1]), *(f"{v:.4g}" for v in r[2:5]), str(r[5])]
        for r in table.itertuples(index=False, name=None)
    ]
    return "\n\n".join([*lines, "\n".join(f"| {' | '.join(row)} |" for row in rows)]) + "\n"


def dataset_about(recording: Recording, lab: LabConfig) -> DatasetAbout:
    """Return the description of a data set: the lab's publication section and the study.

    The study's words are left out where it cannot be found any more.
    """
    fields = lab.publication.model_dump()
    try:
        opened_study = _study_of(recording.path, recording.manifest.study, lab)
    except LabError:
        return DatasetAbout(**fields)
    study = opened_study.study
    experiment = opened_study.experiment(overrides_of(recording.manifest.plan), is_recorded=True)
    source = () if study.report.source is None else (study.report.source.citation,)
    fields["references"] = (*fields["references"], *study.report.references, *source)
    description = f"{study.title}. {study.question}".strip()
    return DatasetAbout(description, own_methods(experiment), **fields)


def _study_of(session: Path, study: str, lab: LabConfig) -> OpenedStudy:
    """Return the study that a session is of: by its folder, else by its name."""
    try:
        return study_of_folder(session.parent.parent, study)[0]
    except LabError:
        return find_study(study, lab.studies)


def _text_rule(study: OpenedStudy | None, lab: LabConfig) -> TextRule:
    """Return which answers to questionnaires are free text; all, where the study is not found."""
    if study is None:
        return lambda questionnaire, question: True
    text_questions = {
        form.name: {q.question_id for q in form.questions() if q.scale.kind == "text"}
        for form in study.questionnaires(lab)
    }

    def is_text(questionnaire: str, question: str) -> bool:
        return questionnaire not in text_questions or question in text_questions[questionnaire]

    return is_text


def _row_rule(study: OpenedStudy | None, recording: Recording) -> RowRule:
    """Return which values of trial rows may leave: those that are described and nobody typed.

    Where the study cannot be found, its design in the recording says what was varied and asked.
    """
    questions = design_of_session(recording.manifest).get("questions", {})
    kinds = {name: question["kind"] for name, question in questions.items()}
    columns = {c.name for c in ENGINE_COLUMNS}
    roles: frozenset[str] = frozenset()
    experiment: StudyExperiment | None = None
    with suppress(LabError):  # a study may have lost a parameter that a session was recorded with
        experiment = None if study is None else study.experiment_of(recording)
    if study is not None and experiment is not None:
        kinds |= {name: kind_of(r) for name, r in experiment.responses.items()}
        columns |= set(trial_columns(experiment, study.measures(experiment)))
        roles = frozenset().union(*(t.roles for t in experiment.read.values()))
    else:
        columns |= set(design_of_session(recording.manifest).get("factors", {}))
        columns |= {f"{name}{ending}" for name in kinds for ending in ANSWER_ENDINGS}
    typed_columns = {name for name, kind in kinds.items() if kind == "Text"}
    typed_columns |= {f"{name}_typed" for name in kinds}

    def leaves(name: str, value: Any) -> bool:
        if name in typed_columns:
            return False
        if name.endswith(f"_{RENDERER}"):
            return False  # the graphics card tells a browser from others
        return name in columns or (of_shown(name, roles) and not isinstance(value, str))

    return leaves
