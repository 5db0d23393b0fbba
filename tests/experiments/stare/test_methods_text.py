from dataclasses import replace

from experiments.stare.analysis_parameters import AnalysisParameters
from experiments.stare.design import StareParameters
from experiments.stare.gaze_changes import GazeChanges
from experiments.stare.methods_text import (
    differences_from_source,
    method_paragraphs,
    stamp_rule,
    study_of,
)
from visavis.looks import DEFAULT_MEASURE_PARAMETERS


def test_design_is_written_from_the_plans_parameters():
    study = study_of({"trial_s": 8.0, "repetitions": 3, "switch_at_01": 0.25, "new_in_2030": 1})
    text = " ".join(method_paragraphs(AnalysisParameters(), study=study))

    assert "3 repetitions = 108 trials of 8 s" in text
    assert "after 25 % of the trial (2 s)" in text
    assert "of a condition (up to 27)" in text


def test_defaults_are_the_sources_72_trials_of_16_s():
    text = " ".join(method_paragraphs(AnalysisParameters()))

    assert "4 conditions × 9 places × 2 repetitions = 72 trials of 16 s" in text
    assert "after half the trial (8 s)" in text


def test_every_changed_parameter_is_a_difference_from_the_source():
    found = " ".join(differences_from_source(StareParameters(trial_s=8.0, look_trigger_ms=100.0)))

    assert "trials lasted 8 s (source: 16 s)" in found
    assert "before the gaze changed: 100 ms (source: 0 ms)" in found
    assert "Set for this study" not in " ".join(differences_from_source(StareParameters()))


def test_one_sample_trigger_is_a_difference_with_its_share_of_fixations():
    changes = GazeChanges(by_look=205, by_time=83, began_fixation=119)
    found = differences_from_source(StareParameters(), changes=changes)

    assert "One gaze sample" in found[-1]
    assert "119 of these 205 looks (58 %)" in found[-1]


def test_different_padding_online_and_offline_is_said():
    found = " ".join(differences_from_source(StareParameters(pad_deg=0.5)))

    assert "padding of 0.5°, the measures with 1°" in found


def test_methods_name_both_confidence_thresholds_and_the_stamp_policy():
    text = " ".join(method_paragraphs(AnalysisParameters()))
    looks = DEFAULT_MEASURE_PARAMETERS.looks

    assert "confidence below 0.6" in text
    assert "confidence below 0.25" in text
    assert stamp_rule(looks) in text
    assert "sorted in" in stamp_rule(looks)
    assert "are refused" in stamp_rule(replace(looks, backward="error", conflicts="error"))
