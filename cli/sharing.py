"""Who may see what of a recording that leaves the lab."""

from pathlib import Path

from lab.config import LabConfig
from lab.errors import LabError, UsageError
from protocol.key_file import KeyFile
from recording.bids_about import DatasetAbout
from recording.reader import Recording
from recording.sharing import TIERS, SharedRecording, Sharing, TextRule, Tier
from visavis.catalogue import find_study
from visavis.methods import own_methods
from visavis.opened import OpenedStudy, overrides_of
from visavis.responses import Text

RISK = (
    "movements of head and body identify people even without a name (Nair et al. 2023, of 55,000 "
    "people 94 % from 100 s): share them only as your consent form says"
)


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
    wanted: Tier | None = next((t for t in TIERS if t == tier), None)
    if wanted is None:
        raise UsageError(f"--tier takes {' or '.join(TIERS)}, not {tier!r}")
    recording = Recording(session)
    label, study = recording.manifest.participant, recording.manifest.study
    if not keep_label and not recording.is_simulated:
        label = KeyFile(lab.key_root, study, [lab.data_root]).pseudonym(label)
    rule, columns = _texts_of(study, lab)
    return SharedRecording(session, Sharing(label, wanted, rule, columns))


def dataset_about(recording: Recording, lab: LabConfig) -> DatasetAbout:
    """Return what a data set of a study says of itself: the lab's publication section, the study.

    The study's words are left out where it cannot be found any more.
    """
    said = lab.publication.model_dump()
    try:
        found = find_study(recording.manifest.study, lab.studies)
    except LabError:
        return DatasetAbout(**said)
    if not isinstance(found, OpenedStudy):
        return DatasetAbout(description=found.title, **said)
    study = found.study
    experiment = found.experiment(overrides_of(recording.manifest.plan))
    source = () if study.source is None else (study.source.citation,)
    said["references"] = (*said["references"], *study.references, *source)
    description = f"{study.title}. {study.question}".strip()
    return DatasetAbout(description, own_methods(experiment), **said)


def _texts_of(study: str, lab: LabConfig) -> tuple[TextRule, frozenset[str]]:
    """Return which answers and columns of a study are free text; of one not found, every answer."""
    try:
        found = find_study(study, lab.studies)
        typed = {
            asked.name: {q.question_id for q in asked.questions() if q.scale.kind == "text"}
            for asked in found.questionnaires(lab)
        }
    except LabError:
        return (lambda questionnaire, question: True), frozenset()
    columns: frozenset[str] = frozenset()
    if isinstance(found, OpenedStudy):
        columns = frozenset(r.name for r in found.study.responses if isinstance(r, Text))

    def is_text(questionnaire: str, question: str) -> bool:
        return questionnaire not in typed or question in typed[questionnaire]

    return is_text, columns
