"""What a recording contains when it is shared outside the lab."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from visavis.analysis.blur_loss import loss_table, motion_of
from visavis.lab.config import LabConfig
from visavis.lab.errors import LabError, UsageError
from visavis.protocol.people.key_file import KeyFile
from visavis.recording.bids_about import DatasetAbout
from visavis.recording.reader import Recording
from visavis.recording.sharing import TIERS, SharedRecording, Sharing, TextRule, Tier
from visavis.results.opened_study import find_study, overrides_of
from visavis.results.report.methods import own_methods
from visavis.study.responses import Text

BLURRED_RISK = (
    "The public tier gives everybody the body of one reference person, smooths movements, tells "
    "gaze on heads in coarse steps and leaves out pupils, eye distances and what cannot be "
    "blurred. This is not anonymity: habits of walking, looking and answering are left, and who "
    "has other recordings of a person may know them again (Nair et al. 2023). Publish it only "
    "where the consent form and the ethics board allow it."
)
LOSS_NAME = "public_tier.md"


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
    rule, columns = _texts_of(study, lab)
    return SharedRecording(
        session, Sharing(label, matching_tier, rule, columns, matching_tier == "public")
    )


def losses(recordings: Sequence[SharedRecording], lab: LabConfig) -> pd.DataFrame:
    """Return what each measure of a study loses by the blur of the public tier."""
    study = find_study(recordings[0].manifest.study, lab.studies)
    before, after, online, motion = [], [], [], []
    for public in recordings:
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
        opened_study = find_study(recording.manifest.study, lab.studies)
    except LabError:
        return DatasetAbout(**fields)
    study = opened_study.study
    experiment = opened_study.experiment(overrides_of(recording.manifest.plan))
    source = () if study.report.source is None else (study.report.source.citation,)
    fields["references"] = (*fields["references"], *study.report.references, *source)
    description = f"{study.title}. {study.question}".strip()
    return DatasetAbout(description, own_methods(experiment), **fields)


def _texts_of(study: str, lab: LabConfig) -> tuple[TextRule, frozenset[str]]:
    """Return which answers and columns are free text; all answers of a study not found."""
    try:
        opened_study = find_study(study, lab.studies)
        text_questions = {
            form.name: {q.question_id for q in form.questions() if q.scale.kind == "text"}
            for form in opened_study.questionnaires(lab)
        }
    except LabError:
        return (lambda questionnaire, question: True), frozenset()
    columns = frozenset(r.name for r in opened_study.study.asks.responses if isinstance(r, Text))

    def is_text(questionnaire: str, question: str) -> bool:
        return questionnaire not in text_questions or question in text_questions[questionnaire]

    return is_text, columns
