"""A device that nothing of a study rests on flags no trial and leaves the check green."""

from pathlib import Path

import pytest

from tests.cli.test_operator_screen import drawn
from tests.faults.sessions import ScriptedOperator
from tests.sessions import STUDIES, perform
from visavis.analysis.session_check import check_session
from visavis.analysis.session_verdict import Level
from visavis.recording.reader import Recording

OPERATOR = ScriptedOperator()


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return perform("greeting", tmp_path_factory.mktemp("idle"), operator=OPERATOR)


def test_a_study_without_gaze_is_green_though_its_tracker_was_never_calibrated(
    session: Recording,
) -> None:
    check = check_session(session)
    assert {""} == set(session.trials()["flags"])
    assert Level.GREEN is check.level, check.findings


def test_the_operator_of_a_study_that_calibrates_nothing_is_told_so(session: Recording) -> None:
    assert session.trials().size
    assert {False} == {status.calibration.is_planned for status in OPERATOR.seen}
    assert "calibration  not needed" in drawn(OPERATOR.seen[-1])


def test_who_measures_by_gaze_and_calibrates_nothing_is_warned(tmp_path: Path) -> None:
    text = (STUDIES / "greeting.py").read_text()
    text = text.replace("Study\n", "Study, dwell_on\n", 1)
    text = text.replace("    compare", '    measures=[dwell_on("person")],\n    compare', 1)
    path = tmp_path / "greeting.py"
    path.write_text(text)
    session = perform(str(path), tmp_path / "data", repetitions=1, practice=0)
    assert {"eye_tracker_warning"} == set(session.trials()["flags"])
    assert Level.AMBER is check_session(session).level
