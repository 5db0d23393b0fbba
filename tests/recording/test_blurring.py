"""What identifies a person in motion is the same for everybody once it is blurred."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from tests.faults.sessions import lab as lab_of
from tests.faults.sessions import perform
from tests.recording.test_export import BELT, gaze_session
from visavis.analysis.gaze.aoi import aoi_of_samples
from visavis.cli.main import app
from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Vector
from visavis.lab.schema import Field, StreamSchema
from visavis.recording.blurring import (
    SEATED_EYE_M,
    SMOOTHING_S,
    STANDING_EYE_M,
    at_height,
    blurred_body,
    blurred_gaze,
    blurred_head,
    blurred_targets,
    heights_m,
    kind_of,
    smooth,
    smooth_turns,
    tells_length,
)
from visavis.recording.journal import encode_line
from visavis.recording.reader import Recording
from visavis.recording.sharing import SharedRecording, Sharing
from visavis.stimuli.motion.skeleton import canonical_skeleton, forward

RATE_HZ = 90
SEGMENTS = ("hips", "chest", "neck", "head", "left_upper_arm", "left_lower_arm", "left_hand")


def stamps(n: int) -> Any:
    return np.arange(n, dtype=np.int64) * NS_PER_S // RATE_HZ


def yawed(yaw_deg: Vector) -> Vector:
    half = np.radians(yaw_deg) / 2
    return np.stack([np.cos(half), 0 * half, np.sin(half), 0 * half], axis=1)


def walk_of(stature_m: float, n: int = 300) -> dict[str, Any]:
    """Return what a tracker says of somebody of a stature who walks and waves the left arm."""
    skeleton = canonical_skeleton(stature_m)
    t_s = np.arange(n) / RATE_HZ
    local = np.tile([1.0, 0.0, 0.0, 0.0], (n, len(skeleton.names), 1))
    swing = 40 * np.sin(2 * np.pi * 0.4 * t_s)
    local[:, skeleton.index("left_upper_arm")] = yawed(swing)
    local[:, 0] = yawed(10 * np.sin(t_s))
    bob = 1 + 0.02 * np.sin(2 * np.pi * 0.5 * t_s)
    root = np.stack([0.8 * t_s, -skeleton.rest_m[:, 1].min() * bob, -0.3 * t_s], axis=1)
    placed = forward(skeleton, root, local)
    at = [skeleton.index(name) for name in SEGMENTS]
    return {
        "seq": np.arange(n),
        "t_host_ns": stamps(n),
        "position_m": placed.position_m[:, at].astype(np.float32),
        "orientation_wxyz": placed.orientation_wxyz[:, at].astype(np.float32),
        "valid": np.ones((n, len(SEGMENTS)), bool),
    }


def shown_body(columns: dict[str, Any]) -> dict[str, Any]:
    return blurred_body(columns, SEGMENTS, float(np.median(heights_m(columns))))


def test_people_of_any_stature_who_move_alike_look_alike() -> None:
    small, tall = (shown_body(walk_of(stature_m)) for stature_m in (1.50, 1.95))
    assert np.abs(walk_of(1.50)["position_m"] - walk_of(1.95)["position_m"]).max() > 0.3
    np.testing.assert_allclose(small["position_m"], tall["position_m"], atol=1e-5)
    np.testing.assert_allclose(small["orientation_wxyz"], tall["orientation_wxyz"], atol=1e-5)


def test_limbs_have_the_lengths_of_the_reference() -> None:
    columns = shown_body(walk_of(1.88))
    arm, elbow, hand = (columns["position_m"][:, SEGMENTS.index(n)] for n in SEGMENTS[-3:])
    assert 0.186 * 1.70 == pytest.approx(np.linalg.norm(elbow - arm, axis=1), abs=1e-5)
    assert 0.146 * 1.70 == pytest.approx(np.linalg.norm(hand - elbow, axis=1), abs=1e-5)


def test_a_segment_below_a_lost_one_is_lost_and_the_others_are_not() -> None:
    columns = walk_of(1.7)
    columns["valid"][100:110, SEGMENTS.index("left_upper_arm")] = False
    columns["position_m"][100:110, SEGMENTS.index("left_upper_arm")] = np.nan
    columns["orientation_wxyz"][100:110, SEGMENTS.index("left_upper_arm")] = np.nan
    shown = shown_body(columns)
    lost = ~shown["valid"][105]
    assert SEGMENTS[-3:] == tuple(np.array(SEGMENTS)[lost])
    assert np.isnan(shown["position_m"][105][lost]).all()
    assert np.isfinite(shown["position_m"][:, ~lost]).all()
    assert shown["valid"][99].all()


def head_at(y_m: Vector) -> dict[str, Any]:
    n = len(y_m)
    turn = yawed(20 * np.sin(np.arange(n) / 40))
    place = np.stack([np.zeros(n), y_m, np.zeros(n)], axis=1)
    return {
        "seq": np.arange(n),
        "t_host_ns": stamps(n),
        "position_m": place,
        "orientation_wxyz": turn,
        "valid": np.ones(n, bool),
    }


@pytest.mark.parametrize(
    ("eye_m", "shown_m"),
    [(1.80, STANDING_EYE_M), (1.45, STANDING_EYE_M), (1.10, SEATED_EYE_M), (0.0, STANDING_EYE_M)],
)
def test_every_head_is_at_the_height_of_the_reference(eye_m: float, shown_m: float) -> None:
    columns = head_at(np.full(200, eye_m))
    shown = blurred_head(columns, float(np.median(heights_m(columns))))
    assert shown_m == pytest.approx(shown["position_m"][:, 1], abs=1e-9)
    assert np.isnan(at_height(np.array([np.nan]), np.array([False]), 1.7, 1.6)).all()


def test_slow_movements_stay_and_quick_ones_go() -> None:
    t_s = np.arange(1800) / RATE_HZ
    for rate_hz in (0.1, 1.0, 3.0):
        wave = np.sin(2 * np.pi * rate_hz * t_s)[:, None]
        shown = smooth(wave, np.ones(1800, bool), stamps(1800))
        expected = np.exp(-2 * (np.pi * rate_hz * SMOOTHING_S) ** 2)
        assert expected == pytest.approx(np.abs(shown[400:-400]).max(), abs=0.01)


def test_what_stands_still_is_kept_and_missing_stays_missing() -> None:
    valid = np.arange(300) % 7 != 0
    shown = smooth(np.full((300, 2), 1.25), valid, stamps(300))
    assert 1.25 == pytest.approx(shown[valid])
    assert np.isnan(shown[~valid]).all()


def test_the_sign_of_a_quaternion_does_not_count() -> None:
    turns = head_at(np.ones(300))["orientation_wxyz"]
    flipped = turns * np.where(np.arange(300) % 3 == 0, -1.0, 1.0)[:, None]
    ones = np.ones(300, bool)
    one, other = (smooth_turns(q, ones, stamps(300)) for q in (turns, flipped))
    assert 1.0 == pytest.approx(np.abs((one * other).sum(axis=1)))


@given(
    st.lists(
        st.tuples(
            st.floats(0, 30), st.floats(0, 30), st.integers(-2, 1), st.sampled_from([0.0, 2.5, 40])
        ),
        min_size=1,
        max_size=30,
    ),
    st.sampled_from([0.0, 0.5, 1.0, 1.5, 2.0]),
)
def test_areas_of_interest_are_decided_as_before(rows: list[Any], pad_deg: float) -> None:
    first, second, hit, limit = (np.array(column) for column in zip(*rows, strict=True))
    n = len(rows)
    angle = np.stack([first, second], axis=1).astype(np.float32)
    radius = np.tile(np.array([[3.0, 4.5]], np.float32), (n, 1))
    columns = {
        "seq": np.arange(n),
        "gaze_seq": np.arange(n),
        "t_host_ns": stamps(n),
        "t_sample_ns": stamps(n),
        "valid": np.ones(n, bool),
        "hit": hit.astype(np.int16),
        "direction_world": np.ones((n, 3)),
        "origin_world_m": np.ones((n, 3)),
        "angle_deg": angle,
        "radius_deg": radius,
        "pad_limit_deg": np.tile(limit[:, None], (1, 2)).astype(np.float32),
    }
    shown = blurred_targets(columns, None, None)
    decided = [
        aoi_of_samples(
            c["angle_deg"], c["radius_deg"], c["pad_limit_deg"], c["hit"], pad_deg=pad_deg
        )
        for c in (columns, shown)
    ]
    one_alone = (angle > radius + 2.0).sum(axis=1) >= 1  # else the nearer of two, in steps
    assert decided[0][one_alone].tolist() == decided[1][one_alone].tolist()
    assert np.isnan(shown["direction_world"]).all()
    assert set(np.unique(shown["angle_deg"] * 4 % 1)) == {0.0}


def test_both_eyes_look_one_way_from_one_point_and_pupils_are_missing() -> None:
    one, other = np.tile([0.0, 0.0, -1.0], (3, 1)), np.tile([0.1, 0.0, -0.99], (3, 1))
    shown = blurred_gaze(
        {
            "direction_head": one,
            "left_direction_head": other,
            "right_direction_head": -other,
            "origin_m": other,
            "left_pupil_mm": np.full(3, 3.5),
            "confidence_01": np.ones(3),
        }
    )
    assert (one == shown["left_direction_head"]).all()
    assert (one == shown["right_direction_head"]).all()
    assert (shown["origin_m"] == 0).all()
    assert np.isnan(shown["left_pupil_mm"]).all()
    assert (shown["confidence_01"] == 1).all()


def test_lengths_of_the_body_are_known_by_their_names() -> None:
    lengths = (
        "eye_height_m",
        "planned_eye_height_m",
        "height_m",
        "left_arm_m",
        "ipd_mm",
        "reach_m",
        "stature_told_m",
    )
    assert all(tells_length(name) for name in lengths)
    assert not any(tells_length(n) for n in ("path_m", "clearance_min_m", "armed_ms", "dwell_ms"))


GLOVE = StreamSchema("glove", (Field("finger_m", "f4", "m", "world", (3,)),), 60.0)


def test_streams_that_cannot_be_blurred_are_left_out(tmp_path: Path) -> None:
    session = gaze_session(tmp_path, own=(BELT, GLOVE))
    assert kind_of(GLOVE) is None
    public = SharedRecording(session.path, Sharing("X1", "public", lambda *_: False, blurs=True))
    assert ("gaze", "head", "belt") == public.stream_names
    assert ("gaze", "head", "belt", "glove") == Recording(session.path).stream_names
    assert STANDING_EYE_M == pytest.approx(public.stream("head")["position_y_m"].median())
    assert public.stream("gaze")["left_pupil_mm"].isna().all()
    part = public.stream_arrays("head", part=1, t_start_ns=5 * NS_PER_S, t_end_ns=6 * NS_PER_S)
    assert 90 == len(part["seq"])


def test_the_stature_that_somebody_told_is_in_no_blurred_event(tmp_path: Path) -> None:
    session = gaze_session(tmp_path).path
    journal = session / "part-01" / "events.jsonl"
    *lines, end = journal.read_bytes().splitlines(keepends=True)
    told = {"body": "female", "stature_told_m": 1.93}
    lines.append(encode_line({"kind": "event", "name": "own_body", "t_ns": 1, "payload": told}))
    journal.chmod(0o600)
    journal.write_bytes(b"".join([*lines, end]))
    shown = {
        blurs: SharedRecording(session, Sharing("X1", "shared", lambda *_: False, blurs=blurs))
        for blurs in (False, True)
    }
    own = {b: r.events().set_index("name").loc["own_body", "payload"] for b, r in shown.items()}
    assert {False: told, True: {**told, "stature_told_m": None}} == own


def test_the_public_tier_says_its_risk_and_what_every_measure_loses(tmp_path: Path) -> None:
    session = perform(lab_of(tmp_path / "lab"), trial_s=1.0)
    out = tmp_path / "out"
    done = CliRunner().invoke(
        app, ["export", str(session.path), "--tier", "public", "-o", str(out)]
    )
    assert 0 == done.exit_code, done.output
    said = (out / "public_tier.md").read_text("utf-8")
    for text in (said, done.output.replace("\n", " ")):
        assert "not anonymity" in text
        assert "Nair et al. 2023" in text
    for measure in ("dwell_ms", "fixation_count", "head_height_m", "head_speed_m_s"):
        assert f"| {measure} |" in said
    shown = SharedRecording(session.path, replace(_RAW, blurs=True))
    assert SEATED_EYE_M == pytest.approx(shown.stream("head")["position_y_m"].median(), abs=1e-3)


_RAW = Sharing("S01", "raw", lambda *_: False)
