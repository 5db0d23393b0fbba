"""Pupil Core's headset calibration, against what Capture's own code makes of the same targets.

tests/reference/devices/pupil_hmd_calibration.json holds targets, pupil normals and the answers of
Capture's own calibration, for references sent y up and sent y down; its frames stand in it.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.devices.bodies import FixatingBody
from tests.devices.rigs import Rig
from tests.devices.test_pupil_core import PERFECT
from visavis.devices.drivers.pupil import codec
from visavis.devices.sim.gaze.calibration import CalibrationJudge
from visavis.lab.geometry import angle_deg, unit

REFERENCE = Path(__file__).parents[1] / "reference" / "devices" / "pupil_hmd_calibration.json"
CASES = json.loads(REFERENCE.read_text(encoding="utf-8"))["cases"]
UPRIGHT = [case for case in CASES if case["reference_axes"] == "y_up_z_forward"]


def name_of(case):
    return f"{case['reference_axes']}, seed {case['seed']}"


@pytest.mark.parametrize("case", UPRIGHT, ids=name_of)
def test_references_are_sent_with_the_axes_with_which_capture_finds_the_eyes(case):
    for target, expected_mm in zip(case["target_head_m"], case["mm_pos"], strict=True):
        sent = codec.encode_reference(np.array(target), 2_000_000_000, 1.0)

        np.testing.assert_allclose(sent["mm_pos"], expected_mm, atol=1e-6)
        assert sent["timestamp"] == 2.0


def simulated_gaze(case):
    """Return the simulator's answer to a case, and the gaze it would then report."""
    judge = CalibrationJudge()
    targets = unit(np.array(case["target_head_m"]))
    stamps_s = np.arange(len(targets)) / 10
    judge.observe(stamps_s, targets, targets, np.ones(len(targets)))
    judge.add_references(
        {"mm_pos": mm, "timestamp": at_s} for mm, at_s in zip(case["mm_pos"], stamps_s, strict=True)
    )
    verdict = judge.verdict()
    turned = targets if verdict.turn is None else targets @ verdict.turn.T
    return verdict, angle_deg(turned, targets)


@pytest.mark.parametrize("case", CASES, ids=name_of)
def test_simulated_capture_answers_as_captures_own_code_does(case):
    verdict, error_deg = simulated_gaze(case)

    vendor = case["vendor"]
    assert (verdict.reason is None) is vendor["success"]
    assert abs(np.median(error_deg) - vendor["gaze_error_deg"]["median"]) < 3.0
    assert abs(error_deg.max() - vendor["gaze_error_deg"]["max"]) < 3.0


def looked_at(rig):
    """Return the mean direction reported for a look 10° to the left and 5° up, and the look."""
    rig.body.look(10.0, 5.0)
    rig.run(0.1)
    rig.batches.clear()
    rig.run(0.5)
    return unit(rig.column("direction_head").astype("f8").mean(axis=0)), rig.body.direction


def test_gaze_is_where_the_eyes_look_once_the_simulated_capture_is_calibrated():
    rig = Rig(error=PERFECT).start()
    assert rig.calibrate().succeeded

    found, truth = looked_at(rig)
    assert angle_deg(found, truth) < 0.1


def test_targets_sent_y_down_leave_simulated_gaze_turned_over_as_they_leave_captures(monkeypatch):
    def y_down(direction_head, device_ns, distance_m):
        x, y, z = (float(v) * distance_m * 1e3 for v in direction_head)
        return {"mm_pos": [x, -y, -z], "timestamp": device_ns / 1e9}

    monkeypatch.setattr(codec, "encode_reference", y_down)
    rig = Rig(error=PERFECT).start()
    assert rig.calibrate().succeeded

    found, truth = looked_at(rig)
    turned_over = FixatingBody(-10.0, -5.0).direction
    assert angle_deg(found, turned_over) < 0.5
    assert angle_deg(found, truth) > 20.0
