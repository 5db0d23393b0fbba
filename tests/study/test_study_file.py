"""A study file: found, planned, refused where it is wrong, performed and analysed."""

import os
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from tests.sessions import opened, perform
from visavis.lab.errors import ConfigError, DesignError, UsageError
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import NextFrame, Plan
from visavis.results.opened_study import find_study
from visavis.results.selection import IS_ANALYSED, REASON
from visavis.study.catalogue import study_of_file
from visavis.study.dry_run import read_trial
from visavis.study.trial import TrialScript

SMALL = {"repetitions": 1, "practice": 1}


def written(folder: Path, text: str, name: str = "own.py") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


HEAD = """from visavis import Choice, Compare, Factor, Rating, Scene, Study
study = Study("own", factors=[Factor("gaze", ["averted", "directed"])])
"""


def test_plan_of_a_study_file_holds_every_cell_as_often_as_repeated() -> None:
    plan = opened("duel").experiment({}).plan(0, 1)
    counted = pd.DataFrame([t.factors for t in plan.trials if not t.is_practice])
    assert [5] * 4 == counted.groupby(["gaze", "side"]).size().tolist()
    assert sum(t.is_practice for t in plan.trials) == 2


def test_what_a_study_leaves_out_of_its_ranges_is_refused_before_its_own_check(
    tmp_path: Path,
) -> None:
    ranged = HEAD.replace(
        'Factor("gaze", ["averted", "directed"])]',
        'Factor("gaze", ["averted", "directed"])], parameters={"clip_s": 2.0}, '
        'ranges={"clip_s": Within(0.5, 3), "gaze": ("averted", "directed")}',
    ).replace("import Choice", "import Within, Choice")
    text = f"{ranged}\n@study.trial\ndef trial(t):\n    yield t.dark(t.clip_s)\n"
    study = find_study(str(written(tmp_path, text)))
    assert 3.0 == study.experiment({"clip_s": 3}).parameters["clip_s"]
    with pytest.raises(DesignError, match=r"own: clip_s is 4; give a number 0\.5 to 3"):
        study.experiment({"clip_s": 4})
    with pytest.raises(DesignError, match="own: no gaze 'up'; choose among averted, directed"):
        study.experiment({"gaze": ["averted", "up"]})


def test_reading_a_trial_passes_quiet_frames_as_a_session_does() -> None:
    def frames_s(quiet_until_ns: int) -> tuple[list[float], float]:
        asked_s: list[float] = []

        def plan(_: TrialScript) -> Plan:
            view = yield NextFrame()
            while view.t_ns < 2_100_000_000:
                asked_s.append(view.t_ns / 1e9)
                view = yield NextFrame(quiet_until_ns)
            return {}

        settings = opened("duel").experiment({}).settings
        return asked_s, read_trial(plan, Trial("T1", 1, 0, False, {}, 1), settings).seconds

    each_s, lasts_s = frames_s(0)
    assert [0.25, 0.5, 0.75] == each_s[:3]
    assert ([0.25, 1.75, 2.0], lasts_s) == frames_s(1_600_000_000)


def test_plan_is_pure() -> None:
    experiment = opened("duel").experiment({})
    assert experiment.plan(3, 7) == experiment.plan(3, 7)
    assert experiment.plan(3, 7) != experiment.plan(4, 7)


def test_texts_fill_placeholders_from_parameters() -> None:
    _, block = opened("duel").experiment({"repetitions": 2}).plan(0, 1).blocks
    assert block.instruction.startswith("8 scenes follow, about 8 seconds each.")


def test_language_of_the_texts_is_chosen_by_name() -> None:
    _, block = opened("duel").experiment({"language": "de"}).plan(0, 1).blocks
    assert block.instruction.startswith("Es folgen 20 Szenen")


def test_language_that_a_study_lacks_is_refused_with_those_it_has() -> None:
    with pytest.raises(ConfigError, match=r"has no fr\.yaml; it has de, en"):
        _ = opened("duel").experiment({"language": "fr"}).texts


def test_levels_of_a_factor_can_be_set() -> None:
    plan = opened("duel").experiment({"side": ["left"], "repetitions": 1}).plan(0, 1)
    assert {t.factors["side"] for t in plan.trials} == {"left"}


@pytest.mark.parametrize(
    ("overrides", "said"),
    [({"repetition": 3}, "did you mean repetitions"), ({"repetitions": 1.5}, "whole number")],
)
def test_parameter_that_is_none_is_refused(overrides: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        _ = opened("duel").experiment(overrides).parameters


def test_file_without_a_trial_says_so(tmp_path: Path) -> None:
    with pytest.raises(DesignError, match="has no trial"):
        study_of_file(written(tmp_path, HEAD))


def test_file_that_declares_no_study_says_so(tmp_path: Path) -> None:
    with pytest.raises(DesignError, match="declares no studies"):
        study_of_file(written(tmp_path, "x = 1\n"))


def test_a_file_changed_twice_within_a_second_is_read_as_it_is_now(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    file = tmp_path / "own.py"
    trial = "\n@study.trial\ndef trial(t):\n    yield t.dark(1)\n"
    for level in ("averted", "lowered"):
        file.write_text(HEAD.replace("averted", level) + trial, "utf-8")
        os.utime(file, (1_700_000_000, 1_700_000_000))
        assert (level, "directed") == study_of_file(file).factor("gaze").levels
    assert [file] == list(tmp_path.iterdir())


def test_error_in_a_study_file_names_file_and_line(tmp_path: Path) -> None:
    path = written(tmp_path, HEAD + "\nundefined_name\n")
    with pytest.raises(DesignError, match=r"own\.py, line 4: NameError"):
        study_of_file(path)


def test_scene_that_does_not_exist_is_told_before_anything_runs(tmp_path: Path) -> None:
    body = "@study.trial\ndef trial(t):\n    yield t.show(Scene('two_peple'), 1)\n"
    study = find_study(str(written(tmp_path, HEAD + body)))
    with pytest.raises(DesignError, match="two_people"):
        study.experiment({})


def test_factor_named_like_a_step_is_refused(tmp_path: Path) -> None:
    text = 'from visavis import Factor, Study\nstudy = Study("own", factors=[Factor("show", [1])])'
    with pytest.raises(DesignError, match="a trial uses it itself"):
        study_of_file(written(tmp_path, text))


def test_unknown_study_names_the_nearest() -> None:
    with pytest.raises(UsageError, match="stare"):
        find_study("star")


def test_reading_a_trial_finds_its_responses_and_its_duration() -> None:
    study, experiment = opened("duel").study, opened("duel").experiment({})
    trial = experiment.plan(0, 1).trials[0]
    found = read_trial(study.trial_plan, trial, experiment.settings)
    assert ["realism"] == [r.name for r in found.responses]
    assert (7.5, 2) == (found.seconds, found.agents)


def test_trial_without_such_a_factor_says_what_there_is() -> None:
    experiment = opened("duel").experiment({})
    script = TrialScript(experiment.plan(0, 1).trials[0], experiment.settings)
    with pytest.raises(AttributeError, match="no factor, parameter or step 'colour'"):
        _ = script.colour


def test_session_is_recorded_and_measured_from_the_recording_alone(tmp_path: Path) -> None:
    recording = perform("duel", tmp_path, **SMALL)
    study = opened("duel")
    intake = study.measure(recording)
    analysis = study.analysis_of([intake])
    rows = analysis.selection.rows
    assert [False] + [True] * 4 == rows[IS_ANALYSED].tolist()
    assert "practice" == rows[REASON].iloc[0]
    assert rows["scene_off_ns"].sub(rows["scene_on_ns"]).eq(4_000_000_000).all()
    assert rows["dwell_ms"].between(0, 4000).all()
    assert rows["realism"].between(1, 9).all()
    assert set(rows["realism_by"]) == {"gaze"}  # no hand is tracked here
    assert analysis.findings[0].outcome is None
    assert "tests need 3" in analysis.findings[0].why_not


def test_study_without_people_is_performed_and_recorded(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        """from visavis import Factor, Rating, Study
study = Study("tone", factors=[Factor("pitch", ["low", "high"])], practice=0)

@study.trial
def trial(t):
    yield t.dark(0.2)
    yield t.ask(Rating("pleasantness", 1, 9))
""",
    )

    recording = perform(str(path), tmp_path / "data")

    assert recording.verify().is_intact
    assert {"complete"} == set(recording.trials()["status"])
    states = recording.stream_arrays("scene_states")
    assert (len(states["seq"]), 0, 3) == states["gaze_direction"].shape
    assert 0 == recording.stream_arrays("gaze_targets")["angle_deg"].shape[1]


def test_same_seed_gives_the_same_session_bit_for_bit(tmp_path: Path) -> None:
    first = perform("duel", tmp_path / "a", **SMALL)
    again = perform("duel", tmp_path / "b", **SMALL)
    assert [s.sha256 for s in first.manifest.parts[0].streams] == [
        s.sha256 for s in again.manifest.parts[0].streams
    ]


@pytest.mark.parametrize(
    ("asks", "wanted"),
    [
        ('t.ask(Rating("realism", 1, 9))', ("eye_tracker",)),
        ('t.ask(Pointing("there"))', ("eye_tracker", "body_tracker")),
        ("t.wait(0.1)", ("eye_tracker",)),
    ],
)
def test_a_body_is_recorded_only_where_a_hand_points(tmp_path, asks, wanted) -> None:
    text = (
        "from visavis import Factor, Pointing, Rating, Scene, Study\n"
        'study = Study("own", factors=[Factor("side", ["left", "right"])])\n'
        "@study.trial\n"
        "def trial(t):\n"
        '    yield t.show(Scene("two_people", active=t.side), seconds=0.2)\n'
        f"    yield {asks}\n"
    )

    assert wanted == find_study(str(written(tmp_path, text))).experiment({}).useful_roles


def test_a_hand_answers_on_boards_where_no_gaze_is_calibrated(tmp_path) -> None:
    text = (
        "from visavis import Factor, Rating, Study\n"
        'study = Study("own", factors=[Factor("side", ["left", "right"])], calibrate=False)\n'
        "@study.trial\n"
        "def trial(t):\n"
        '    yield t.ask(Rating("realism", 1, 9))\n'
    )

    assert "body_tracker" in find_study(str(written(tmp_path, text))).experiment({}).useful_roles
