"""Pages of the trials that a report asks to look at, in a folder beside it."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from visavis.cli.notifier import NOTIFIER
from visavis.cli.viewer.content import page_content, trial_lengths_ns
from visavis.cli.viewer.page import page_of
from visavis.lab.errors import DesignError
from visavis.recording.cached import CachedRecording
from visavis.recording.durable import make_folder, replace_file
from visavis.recording.reader import Recording
from visavis.results.unusual import VIEWS, view_name
from visavis.running.sessions.study_folder import study_of_folder, study_of_session, words_on_files
from visavis.study.cast import use_recorded_cast
from visavis.study.sections import TrialToSee


def write_views(folder: Path, out_dir: Path, striking: Sequence[TrialToSee]) -> None:
    """Write one page for every session of a study's `folder` with trials to look at.

    Trials that never began have nothing to show; a page made before is replaced. Of a session whose
    pictures are gone none is made, one made before stays, and both are said.
    """
    of_session = groupby(sorted(striking, key=_session), key=_session)
    trials_by_session = {key: tuple(one.trial_id for one in trials) for key, trials in of_session}
    sessions = [Recording(folder / f"sub-{who}" / session) for who, session in trials_by_session]
    if sessions and (words := words_on_files(study_of_session(sessions[0])[0], sessions)):
        NOTIFIER.warn(words)
    with NOTIFIER.progress("making pages of trials") as on_progress:
        for number, ((participant, session), names) in enumerate(trials_by_session.items()):
            on_progress(number, len(trials_by_session))
            recording = CachedRecording(folder / f"sub-{participant}" / session)
            use_recorded_cast(recording)
            study, _ = study_of_folder(folder, recording.manifest.study)
            there = trial_lengths_ns(recording)
            trial_ids = [name for name in dict.fromkeys(names) if name in there]
            path = out_dir / VIEWS / view_name(participant, session)
            try:
                header, bundle = page_content(study, recording, trial_ids, lambda _, __: None)
            except DesignError as problem:  # a picture that was shown is gone
                what, ending = "page", ""
                if path.is_file():
                    what, ending = "new page", f"; the report opens {path.name} of before"
                NOTIFIER.warn(f"no {what} of trials of {recording.path}: {problem}{ending}")
                continue
            make_folder(out_dir / VIEWS, exist_ok=True)
            replace_file(path, page_of(header, bundle).encode())
        on_progress(len(trials_by_session), len(trials_by_session))


def _session(one: TrialToSee) -> tuple[str, str]:
    return one.participant, one.session
