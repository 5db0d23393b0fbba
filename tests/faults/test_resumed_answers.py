"""Questions that a broken-off session left open are answered as they would have been."""

from pathlib import Path
from typing import cast

import pytest

from benchmarks.kill_resume import _ShortSessions, fast_config
from visavis.experiments.crowd.participant.participant import CrowdParticipant
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.sessions.perform import perform_new, perform_rest

ASKED_BEFORE = 3


class _Ended(BaseException):
    """The process is gone."""


def answers(recording: Recording) -> dict[tuple[str, str], object]:
    events = recording.events()
    return {
        (p["questionnaire"], p["question"]): p["answer"]
        for p in events.loc[events["name"] == "answer", "payload"]
    }


def test_answers_after_a_block_do_not_depend_on_a_resume(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = _ShortSessions(cast(OpenedStudy, find_study("crowd")), fast_config())
    whole = answers(Recording(perform_new(short.request(tmp_path / "whole"))))
    of_blocks = {question for name, question in whole if "@" in name}
    answer, asked = CrowdParticipant.answer, []

    def until_the_end(self, question_id, prompt, options):
        asked.extend([question_id] if question_id in of_blocks else [])
        if len(asked) > ASKED_BEFORE:
            raise _Ended
        return answer(self, question_id, prompt, options)

    request = short.request(tmp_path / "broken")
    monkeypatch.setattr(CrowdParticipant, "answer", until_the_end)
    with pytest.raises(_Ended):
        perform_new(request)
    monkeypatch.setattr(CrowdParticipant, "answer", answer)
    (path,) = (tmp_path / "broken").rglob("ses-001")
    assert len(answers(Recording(path))) == ASKED_BEFORE
    perform_rest(short.request(tmp_path / "broken"), path)
    assert answers(Recording(path)) == whole
    assert len(whole) > 10
