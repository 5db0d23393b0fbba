"""The codec of Pupil Capture's messages: known vectors, round trips, and bytes of any kind."""

import math

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.devices.drivers.pupil import codec
from visavis.devices.drivers.streaming.gaze_rays import diameter_mm, rows_to_values
from visavis.devices.sim.pupil.wire import (
    BINOCULAR_TOPIC,
    COLUMN,
    GAZE_VALUES,
    MONOCULAR_TOPICS,
    GazeTemplate,
)


def pupil(eye, confidence=0.9, **more):
    return {"id": eye, "confidence": confidence, "timestamp": 1.5, "diameter_3d": 3.0 + eye, **more}


def binocular(**changes):
    """Right eye (0) straight ahead, left eye (1) 45° to the right and down."""
    datum = {
        "topic": "gaze.3d.01.",
        "eye_centers_3d": {"0": [32.0, 0.0, 0.0], "1": [-32.0, 4.0, 2.0]},
        "gaze_normals_3d": {"0": [0.0, 0.0, 1.0], "1": [1.0, 1.0, 0.0]},
        "gaze_point_3d": [0.0, 0.0, 500.0],
        "norm_pos": [0.5, 0.5],
        "confidence": 0.9,
        "timestamp": 1.5,
        "base_data": [pupil(0), pupil(1)],
    }
    return datum | changes


def decoded(datum, threshold_01=0.6):
    stamp_ns, row = codec.decode_gaze(msgpack.packb(datum), threshold_01)
    return stamp_ns, rows_to_values([row])[0]


def test_camera_frame_turns_into_head_frame_in_metres():
    stamp_ns, sample = decoded(binocular())

    assert stamp_ns == 1_500_000_000
    np.testing.assert_allclose(sample["right_direction_head"], [0, 0, -1], atol=1e-7)
    half = math.sqrt(0.5)
    np.testing.assert_allclose(sample["left_direction_head"], [half, -half, 0], atol=1e-7)
    np.testing.assert_allclose(sample["origin_m"], [0.0, -0.002, -0.001], atol=1e-7)


def test_combined_ray_is_the_mean_of_both_eyes():
    _, sample = decoded(binocular())

    half = math.sqrt(0.5)
    expected = np.array([half, -half, -1]) / math.sqrt(2)
    np.testing.assert_allclose(sample["direction_head"], expected, atol=1e-6)
    assert sample["eyes_used"] == 3
    assert (sample["left_pupil_mm"], sample["right_pupil_mm"]) == (4.0, 3.0)


def test_integer_eye_keys_of_old_versions_are_read():
    normals = {0: [0.0, 0.0, 1.0], 1: [0.0, 0.0, 1.0]}
    centers = {0: [32.0, 0.0, 0.0], 1: [-32.0, 0.0, 0.0]}

    _, sample = decoded(binocular(gaze_normals_3d=normals, eye_centers_3d=centers))

    np.testing.assert_allclose(sample["direction_head"], [0, 0, -1], atol=1e-7)


def test_eye_below_threshold_is_left_out_of_the_combined_ray():
    _, sample = decoded(binocular(base_data=[pupil(0), pupil(1, 0.3)]))

    np.testing.assert_allclose(sample["direction_head"], [0, 0, -1], atol=1e-7)
    assert sample["eyes_used"] == 2
    assert sample["valid"]
    assert not sample["left_valid"]


def test_sample_below_threshold_keeps_its_value_and_is_invalid():
    _, sample = decoded(binocular(confidence=0.2, base_data=[pupil(0, 0.2), pupil(1, 0.2)]))

    assert not sample["valid"]
    assert np.isfinite(sample["direction_head"]).all()


def test_monocular_datum_knows_its_eye_from_the_topic():
    datum = binocular(topic="gaze.3d.1.", base_data=[pupil(1)])
    del datum["gaze_normals_3d"], datum["eye_centers_3d"]
    datum |= {"gaze_normal_3d": [0.0, 0.0, 2.0], "eye_center_3d": [-32.0, 0.0, 0.0]}

    _, sample = decoded(datum)

    assert sample["eyes_used"] == 1
    np.testing.assert_allclose(sample["left_direction_head"], [0, 0, -1], atol=1e-7)
    assert np.isnan(sample["right_direction_head"]).all()
    assert np.isnan(sample["right_pupil_mm"])


def test_zero_vector_is_missing_not_a_direction():
    normals = {"0": [0.0, 0.0, 0.0], "1": [0.0, 0.0, 0.0]}

    _, sample = decoded(binocular(gaze_normals_3d=normals))

    assert np.isnan(sample["direction_head"]).all()
    assert not sample["valid"]
    assert sample["eyes_used"] == 0


def test_zero_pupil_is_missing():
    base = [pupil(0) | {"diameter_3d": 0.0}, pupil(1)]

    _, sample = decoded(binocular(base_data=base))

    assert np.isnan(sample["right_pupil_mm"])


@pytest.mark.parametrize("missing", ["timestamp", "confidence", "eye_centers_3d"])
def test_datum_without_a_needed_field_is_malformed(missing):
    datum = binocular()
    del datum[missing]

    assert codec.decode_gaze(msgpack.packb(datum), 0.6) is None


@given(st.binary(max_size=300))
def test_arbitrary_bytes_never_raise(payload):
    result = codec.decode_gaze(payload, 0.6)

    assert result is None or len(result) == 2
    found = codec.decode_notification(payload)
    assert found is None or isinstance(found["subject"], str)


JUNK = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers(-(2**63), 2**63) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=6,
)


@given(st.sampled_from(sorted(binocular())), JUNK)
def test_any_value_in_any_field_never_raises(name, junk):
    result = codec.decode_gaze(msgpack.packb(binocular(**{name: junk})), 0.6)

    assert result is None or len(result) == 2


@given(st.data())
def test_cut_or_flipped_messages_never_raise(data):
    packed = bytearray(msgpack.packb(binocular()))
    cut = data.draw(st.integers(0, len(packed)))
    for _ in range(data.draw(st.integers(0, 4))):
        packed[data.draw(st.integers(0, len(packed) - 1))] = data.draw(st.integers(0, 255))

    result = codec.decode_gaze(bytes(packed[:cut]), 0.6)

    assert result is None or len(result) == 2


FLOATS = st.floats(-100, 100, allow_nan=False)


@given(
    st.sampled_from([(0, 1), (0,), (1,)]),
    st.lists(FLOATS, min_size=len(GAZE_VALUES), max_size=len(GAZE_VALUES)),
)
def test_template_packs_what_msgpack_would(eyes, numbers):
    topic = BINOCULAR_TOPIC if len(eyes) == 2 else MONOCULAR_TOPICS[eyes[0]]
    template = GazeTemplate(topic, dict.fromkeys(eyes, (1.0, 2.0, 3.0)))
    row = np.array([numbers])

    ((sent_topic, payload),) = template.pack(row)

    datum = msgpack.unpackb(payload)
    assert sent_topic == topic
    assert msgpack.packb(datum) == payload
    assert datum["timestamp"] == numbers[COLUMN["timestamp"]]
    assert datum["norm_pos"] == [numbers[COLUMN["norm_x"]], numbers[COLUMN["norm_y"]]]
    at = COLUMN[f"normal{eyes[-1]}_x"]
    normal = datum["gaze_normals_3d"][str(eyes[-1])] if len(eyes) == 2 else datum["gaze_normal_3d"]
    assert normal == numbers[at : at + 3]
    assert [p["diameter_3d"] for p in datum["base_data"]] == [
        numbers[COLUMN[f"diameter{eye}_mm"]] for eye in eyes
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [("3.5.1", (3, 5, 1)), ("v2.0-12-gabc", (2, 0)), ("1.23", (1, 23)), ("", None), ("x", None)],
)
def test_version_is_its_leading_numbers(text, expected):
    assert codec.decode_version(text) == expected


def test_time_answer_that_is_no_number_is_none():
    assert codec.decode_time((b"Unknown command.",)) is None
    assert codec.decode_time((b"nan",)) is None
    assert codec.decode_time(()) is None
    assert codec.decode_time((b"12.5",)) == 12_500_000_000


def test_reference_is_written_in_camera_millimetres():
    reference = codec.encode_reference(np.array([0.6, 0.0, -0.8]), 2_000_000_000, 0.5)

    assert reference["timestamp"] == 2.0
    np.testing.assert_allclose(reference["mm_pos"], [300.0, 0.0, 400.0])


@pytest.mark.parametrize("diameter", [0.0, -1.0, 7.7e-304, 0.4, 20.0, 3e38, math.inf, math.nan])
def test_a_diameter_that_no_pupil_has_is_missing(diameter):
    told = [pupil(0, diameter_3d=diameter), pupil(1, diameter_3d=3.0)]
    _, sample = decoded(binocular(base_data=told))
    assert math.isnan(sample["right_pupil_mm"])
    assert sample["left_pupil_mm"] == pytest.approx(3.0)
    assert math.isnan(diameter_mm(diameter))
