"""A tracker that was opened anew is calibrated before the first trial it records."""

from dataclasses import replace
from pathlib import Path

import pytest

from tests.faults.sessions import FewTrials, ScriptedOperator, events, lab, path_of, request
from visavis.experiments.stare.study import study
from visavis.lab.errors import SessionAborted
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.protocol.session.operator import Action, Command
from visavis.protocol.session.states import SessionState
from visavis.recording.reader import Recording
from visavis.running.sessions.perform import perform_new, perform_rest


class CalibratedOnce(FewTrials):
    """The same, calibrated before the first block alone, as studies without gaze measures are."""

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return blocks of which only the first calibrates."""
        whole = super().plan(participant_index, seed, group)
        first, *others = whole.blocks
        return replace(whole, blocks=(first, *(replace(b, calibrate=False) for b in others)))


def test_a_session_resumed_in_a_block_that_does_not_calibrate_is_calibrated(
    tmp_path: Path,
) -> None:
    config = lab(tmp_path)
    session_request = request(config)
    session_request = replace(
        session_request, experiment=CalibratedOnce(study, session_request.experiment.parameters)
    )
    operator = ScriptedOperator((SessionState.BREAK, 2, 2, Command(Action.ABORT)))
    with pytest.raises(SessionAborted):
        perform_new(replace(session_request, operator=operator))

    session = Recording(perform_rest(session_request, path_of(config)))

    rows = session.trials()
    assert [1, 2] == sorted(set(rows["part"]))
    assert rows["calibration_accepted"].tolist() == [True] * len(rows)
    calibrated = session.events().query("name == 'calibration'")["recording_part"]
    assert {1, 2} == set(calibrated)
    assert {0, 2} == {e["block"] for e in events(session, "calibration")}
