"""A study's page in a headset, simulated: entered, recorded as a lab's, checked, refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.running.page.pages import config
from tests.running.page.test_elsewhere import Host
from tests.running.page.test_live_scenes import STUDY, study_in
from visavis.analysis.session_check import check_session
from visavis.cli.main import app
from visavis.lab.clock import SimClock
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import DesignError
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.results.tables.dictionary import trial_columns
from visavis.running.film_store import film_store
from visavis.running.page.headset_information import headset_information
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.study.experiment import StudyExperiment
from visavis.study.information import facts_in_event, information_on_page

IN_HEADSET = STUDY.replace("calibrate=False,", 'calibrate=False, on="browser", xr="optional",')
STREAMS = ("head", "frame_timing", "pointer", "responses")


def perform(root: Path, text: str = IN_HEADSET) -> tuple[OpenedStudy, Recording]:
    """Return the session of somebody simulated, at the page of a study."""
    study = study_in(root, text)
    request = simulated_request(
        study, study.experiment({}), config(root), label="S01", index=0, seed=1, effect=True
    )
    return study, Recording(perform_new(replace(request, on="browser", clock=SimClock())))


def test_a_simulated_session_in_a_headset_is_recorded_as_a_lab_s_and_marked_simulated(
    tmp_path: Path,
) -> None:
    study, recording = perform(tmp_path)
    assert "complete" == recording.status
    assert recording.is_simulated
    assert STREAMS == recording.stream_names
    rows = recording.trials()
    assert ["complete"] * 2 == list(rows["status"])
    assert {"headset"} == {*rows["seen_in"]}
    assert {"ray"} == {*rows["lively_by"], *rows["heavy_by"]}
    assert {""} == {*rows["flags"]}
    head = recording.stream_arrays("head")
    assert list(range(len(head["seq"]))) == list(head["seq"])
    assert 1.6 == pytest.approx(np.median(head["position_m"][:, 1]), abs=0.01)
    for row in rows.to_dict("records"):
        is_within = (head["t_host_ns"] >= row["t_start_ns"]) & (head["t_host_ns"] < row["t_end_ns"])
        seconds = (row["t_end_ns"] - row["t_start_ns"]) / 1e9
        assert 72 * seconds == pytest.approx(is_within.sum(), abs=2)
    events = recording.events()
    entered = events.loc[events["name"] == "headset_entered", "payload"].iloc[0]
    version = headset_information(study.experiment({}).texts).version
    assert (True, version, 72.0) == (entered["entered"], entered["version"], entered["rate_hz"])
    asked = events.loc[events["name"] == "discomfort", "payload"]
    assert ["before", "after"] == [payload["moment"] for payload in asked]
    assert set(rows.columns) <= trial_columns(study.experiment({}), ()).keys() | {"recording_part"}


def test_four_minutes_before_a_simulated_answer_are_sent_in_posts_that_a_server_takes(
    tmp_path: Path,
) -> None:
    before, _, trial = IN_HEADSET.partition("yield")
    _, recording = perform(tmp_path, f"{before}yield t.dark(240)\n    yield{trial}")
    assert "complete" == recording.status
    head = recording.stream_arrays("head")
    assert list(range(len(head["seq"]))) == list(head["seq"])
    assert 2 * 240 * 72 < len(head["seq"])


def test_check_tells_of_a_headset_s_streams_by_their_numbers(tmp_path: Path) -> None:
    _, recording = perform(tmp_path)
    streams = {s.stream: s for s in check_session(recording).streams}
    assert streams["head"].rows == streams["head"].expected
    assert "green" == streams["head"].level.name.lower()


def test_people_are_told_of_everything_that_a_headset_sends(tmp_path: Path) -> None:
    study, recording = perform(tmp_path)
    made = study.experiment({})
    lines = information_on_page(made, ()).lines
    events = recording.events()
    facts = set[str]().union(
        *(facts_in_event(n, p) for n, p in zip(events["name"], events["payload"], strict=True))
    )
    assert {"headset", "head", "presses", "shown"} <= facts
    assert {made.texts.get(f"recorded.{fact}", {"titles": ""}) for fact in facts} <= set(lines)
    flat = study_in(tmp_path / "flat", STUDY).experiment({})
    assert made.texts.get("recorded.head") not in information_on_page(flat, ()).lines


def test_hands_are_asked_for_and_told_only_where_a_study_names_them(tmp_path: Path) -> None:
    plain = study_in(tmp_path / "plain", IN_HEADSET).experiment({})
    named = IN_HEADSET.replace('xr="optional"', 'xr="optional", uses=["hands"]')
    with_hands = study_in(tmp_path / "hands", named).experiment({})
    assert STREAMS == plain.headset_streams
    assert (*STREAMS, "hands") == with_hands.headset_streams
    assert with_hands.texts.get("recorded.hands") in information_on_page(with_hands, ()).lines


def experiment_in_headset(name: str) -> StudyExperiment:
    """Return a shipped study whose page would enter a headset."""
    shipped = find_study(name)
    assert isinstance(shipped, OpenedStudy)
    changed = shipped.study.with_changes(on="browser", xr="optional")
    return StudyExperiment(changed, {})


@pytest.mark.parametrize(
    ("name", "reasons"),
    [
        ("stare", ["stare", "gaze", "openxr_gaze"]),
        ("crowd", ["crowd", "armbands", "floor of", "body of their own"]),
        ("waving", ["waving", "single frames", "perform waving_page"]),
        ("interpolation", ["films", "LiveScene"]),
    ],
)
def test_a_study_that_no_page_in_a_headset_can_do_is_refused_by_name_with_the_way_out(
    name: str, reasons: list[str]
) -> None:
    with pytest.raises(DesignError) as caught:
        film_store(experiment_in_headset(name))
    assert [r for r in reasons if r not in str(caught.value)] == []


def test_a_refusal_comes_at_plan_before_anything_is_written(tmp_path: Path) -> None:
    (tmp_path / "apart.py").write_text(
        IN_HEADSET.replace("calibrate=False,", 'needs=["eye_tracker"],'), "utf-8"
    )
    (tmp_path / "lab_config.yaml").write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    command = ["plan", str(tmp_path / "apart.py"), "--config", str(tmp_path / "lab_config.yaml")]
    answer = CliRunner().invoke(app, command)
    assert 0 != answer.exit_code
    assert "needs gaze" in " ".join(str(answer.exception or answer.output).split())
    assert not (tmp_path / "data").exists()


def test_what_would_be_typed_in_a_headset_is_refused(tmp_path: Path) -> None:
    typed = IN_HEADSET.replace('Rating("heavy", 1, 5)', 'FreeText("heavy")')
    typed = typed.replace("Factor, Live,", "Factor, FreeText, Live,")
    with pytest.raises(DesignError, match="heavy would be typed"):
        study_in(tmp_path, typed).experiment({}).check_in_headset()


@pytest.mark.parametrize("name", ["bundle", "bundle.jzip"])
@pytest.mark.parametrize("xr", ["optional", "required"])
def test_a_bundle_of_a_study_in_a_headset_is_refused_by_name_and_leaves_nothing(
    tmp_path: Path, name: str, xr: str
) -> None:
    host = Host(tmp_path, IN_HEADSET.replace("optional", xr))
    with pytest.raises(DesignError, match=r'apart enters a headset.*serve it.*xr="never"'):
        host.export(name)
    assert [] == [p.name for p in tmp_path.iterdir() if "bundle" in p.name]


def test_another_word_for_xr_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DesignError, match="'never', 'optional' or 'required'"):
        study_in(tmp_path, IN_HEADSET.replace('"optional"', '"sometimes"'))
