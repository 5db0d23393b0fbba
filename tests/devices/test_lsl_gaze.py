"""LSL gaze streams: channels by their meta-data, raw stamps, and a real outlet in a child."""

import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.devices.gaze_rigs import PERFECT, GazeRig
from visavis.devices.drivers.lsl import gaze_codec as codec
from visavis.devices.drivers.lsl.gaze import LslGaze, TobiiLsl
from visavis.devices.drivers.streaming.gaze_rays import rows_to_values
from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.sim.lsl.gaze import LAYOUTS, LslGazeSimulator, titta_rows
from visavis.lab.errors import ProtocolViolation
from visavis.lab.geometry import angle_deg

ROOT = Path(__file__).parents[2]
SCREEN = Screen(500.0, 300.0, 600.0)


def info_of(*rows):
    return codec.StreamInfo("s", "id", 60.0, len(rows), rows)


def row_of(layout, *values):
    sample = codec.decode_sample(struct.pack(f"<{len(values)}d", *values), layout, SCREEN, 0.03)
    return sample, rows_to_values([sample.row])[0]


def screen_channels(unit):
    return info_of(
        {"type": "ScreenX", "eye": "both", "unit": unit},
        {"type": "ScreenY", "eye": "both", "unit": unit},
        {"type": "PupilRadius", "eye": "left", "unit": "mm"},
    )


def test_stamp_is_kept_raw():
    layout = codec.layout_of(screen_channels("normalized"))

    assert row_of(layout, 12.000000125, 0.5, 0.5, 1.0)[0].t_device_ns == 12_000_000_125


@pytest.mark.parametrize(("unit", "x", "y"), [("normalized", 1.0, 0.5), ("pixels", 1920, 540)])
def test_screen_points_become_rays_by_their_unit(unit, x, y):
    _, row = row_of(codec.layout_of(screen_channels(unit)), 1.0, x, y, 1.5)

    right = np.array([0.25, 0.0, -0.6])
    np.testing.assert_allclose(row["direction_head"], right / np.linalg.norm(right), atol=1e-6)
    assert row["left_pupil_mm"] == 3.0
    assert row["valid"]


def test_missing_numbers_are_missing_never_zero():
    _, row = row_of(codec.layout_of(screen_channels("normalized")), 1.0, *[float("nan")] * 3)

    assert not row["valid"]
    assert np.isnan(row["direction_head"]).all()
    assert np.isnan(row["left_pupil_mm"])


TITTA = {
    "x.position_on_display_area.gaze_point": 0.5,
    "y.position_on_display_area.gaze_point": 0.5,
    "x.position_in_user_coordinates.gaze_point": 0.0,
    "y.position_in_user_coordinates.gaze_point": 170.0,  # the tracker sits below the screen
    "z.position_in_user_coordinates.gaze_point": 0.0,
    "valid.gaze_point": 1.0,
    "diameter.pupil": 3.2,
    "valid.pupil": 1.0,
    "x.position_in_user_coordinates.gaze_origin": -30.0,
    "y.position_in_user_coordinates.gaze_origin": 190.0,
    "z.position_in_user_coordinates.gaze_origin": 650.0,
    "valid.gaze_origin": 1.0,
}


def titta_row(**changes):
    numbers = {**TITTA, **changes}
    described = [{"label": f"{name}.left_eye"} for name in numbers]
    info = codec.StreamInfo("Tobii_gaze", "", 60.0, len(described) + 1, tuple(described))
    return row_of(codec.layout_of(info), 1.0, *numbers.values(), 1234.5)[1]


def test_labels_are_those_of_tittalsl_and_one_channel_is_undescribed():
    """Labels, order and count as in dcnieho/Titta, src/TittaLSL.cpp, Sender::start, pushSample."""
    labels = [row["label"] for row in titta_rows()]

    assert len(labels) == 42
    assert labels[0] == "x.position_on_display_area.gaze_point.left_eye"
    assert labels[20] == "available.eye_openness.left_eye"
    assert labels[28] == "diameter.pupil.right_eye"
    layout = codec.layout_of(codec.StreamInfo("Tobii_gaze", "", 600.0, 43, tuple(titta_rows())))
    assert layout.count == 43
    assert {kind for eye, kind in layout.places if eye == "right"} == set(codec.TITTA_LABELS)


def test_tobii_eye_is_as_far_from_its_point_as_the_tracker_says():
    row = titta_row()

    ray = np.array([30.0, -20.0, -650.0])
    np.testing.assert_allclose(row["left_direction_head"], ray / np.linalg.norm(ray), atol=1e-6)
    np.testing.assert_allclose(row["origin_m"], (-0.03, 0.02, 0.05), atol=1e-6)
    assert (row["eyes_used"], row["left_pupil_mm"]) == (1, np.float32(3.2))


@pytest.mark.parametrize(
    ("flag", "column", "is_missing"),
    [
        ("valid.gaze_point", "left_valid", lambda value: not value),
        ("valid.pupil", "left_pupil_mm", np.isnan),
    ],
)
def test_tobii_value_that_is_not_valid_is_missing(flag, column, is_missing):
    assert is_missing(titta_row(**{flag: 0.0})[column])


def test_tobii_eye_whose_place_is_not_valid_looks_from_the_viewing_place():
    row = titta_row(**{"valid.gaze_origin": 0.0})

    ray = np.array([0.03, 0.0, -0.6])
    np.testing.assert_allclose(row["left_direction_head"], ray / np.linalg.norm(ray), atol=1e-6)
    assert row["left_valid"]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("driver", [LslGaze, TobiiLsl])
def test_every_layout_gives_the_body_direction(layout, driver):
    rig = GazeRig(driver, LslGazeSimulator, error=PERFECT, layout=layout).start().run(0.5)

    errors_deg = angle_deg(rig.column("direction_head").astype("f8"), rig.body.direction)
    assert errors_deg.max() < 0.01
    frame = "head_frame" if layout == "xdf" else "screen_frame"
    assert rig.driver.info.capabilities == {"gaze", "per_eye", "pupil", frame}


def test_rate_is_the_streams_own():
    rig = GazeRig(LslGaze, LslGazeSimulator, rate_hz=250.0).start()

    assert rig.driver.describe()[0].nominal_rate_hz == 250.0


def test_directions_of_unsaid_frame_are_told():
    rows = [{"type": f"Direction{a}", "eye": "both", "unit": "normalized"} for a in "XYZ"]

    assert not codec.layout_of(info_of(*rows)).states_frame


def test_stream_without_gaze_is_refused(monkeypatch):
    rig = GazeRig(LslGaze, LslGazeSimulator)
    monkeypatch.setattr(
        rig.simulator, "xml", lambda: b"<info><channel_count>0</channel_count></info>"
    )

    with pytest.raises(ProtocolViolation, match="names no gaze channels"):
        rig.driver.open(2.0)


@given(st.binary(max_size=200), st.binary(max_size=300))
def test_any_document_and_sample_are_read_or_refused(document, raw):
    assert codec.parse_info(document) is None or isinstance(
        codec.parse_info(document), codec.StreamInfo
    )
    layout = codec.layout_of(screen_channels("normalized"))
    codec.decode_sample(raw, layout, SCREEN, 0.03)
    codec.decode_sample(raw.ljust(32, b"\xff")[:32], layout, SCREEN, 0.03)


def test_real_outlet_is_found_read_and_timed():
    pytest.importorskip("pylsl", reason="pip install pylsl")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    environment.pop("LSLAPICFG", None)
    child = subprocess.run(
        [sys.executable, "-m", "tests.devices.lsl_gaze_child", str(os.getpid())],
        capture_output=True,
        text=True,
        timeout=60,
        env=environment,
        cwd=ROOT,
    )
    assert child.returncode == 0, child.stderr
    found = json.loads(child.stdout.splitlines()[-1])
    assert found["error_deg"] < 0.01
    assert found["gaps"] == 0
    assert abs(found["offset_ms"]) < 2.0
    assert "per_eye" in found["capabilities"]
