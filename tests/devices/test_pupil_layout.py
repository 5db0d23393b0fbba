"""The short cut through known layouts reads exactly what the codec reads, or nothing."""

import msgpack
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tests.devices.test_pupil_codec import binocular, pupil
from visavis.devices.contracts import GAZE
from visavis.devices.drivers.pupil import codec
from visavis.devices.drivers.pupil.layout import GazeDecoder, learn_layout
from visavis.devices.sim.pupil.wire import (
    BINOCULAR_TOPIC,
    GAZE_VALUES,
    MONOCULAR_TOPICS,
    GazeTemplate,
)

THRESHOLD_01 = 0.6
CENTERS = {0: (32.0, 0.0, 0.0), 1: (-32.0, 0.0, 0.0)}
BOTH = GazeTemplate(BINOCULAR_TOPIC, CENTERS)

NUMBERS = st.lists(
    st.floats(-2, 2) | st.floats() | st.sampled_from([0.0, 0.6, 1.0, 3.5e38, -1e-9]),
    min_size=len(GAZE_VALUES),
    max_size=len(GAZE_VALUES),
)


def read(decoder, payload):
    rows, stamps = np.zeros(2 * GAZE.dtype.itemsize, np.uint8), np.zeros(2, np.int64)
    if not decoder.decode(payload, rows, stamps, 1):
        return None
    return int(stamps[1]), rows[GAZE.dtype.itemsize :].tobytes()


def datum(numbers):
    return BOTH.pack(np.array([numbers]))[0][1]


def taught():
    decoder = GazeDecoder(THRESHOLD_01)
    read(decoder, datum([0.5] * len(GAZE_VALUES)))
    return decoder


# Compiling takes longer than an example may.
read(taught(), datum([0.5] * len(GAZE_VALUES)))


@given(NUMBERS)
def test_known_layout_gives_the_very_bytes_of_the_codec(numbers):
    payload = datum(numbers)

    assert codec.decode_gaze(payload, THRESHOLD_01) == read(taught(), payload)


@given(st.data())
def test_flipped_bytes_are_read_as_the_codec_reads_them(data):
    packed = bytearray(datum([0.5] * len(GAZE_VALUES)))
    for _ in range(data.draw(st.integers(1, 4))):
        packed[data.draw(st.integers(0, len(packed) - 1))] = data.draw(st.integers(0, 255))
    payload = bytes(packed)

    assert codec.decode_gaze(payload, THRESHOLD_01) == read(taught(), payload)


@given(st.lists(st.sampled_from([0, 1, 2, 3]), max_size=12))
def test_mixed_data_are_read_as_the_codec_reads_them(kinds):
    rng = np.random.default_rng(len(kinds))
    decoder = GazeDecoder(THRESHOLD_01)
    swapped = binocular(base_data=[pupil(1, 0.3), pupil(0, 0.9)])
    for kind in kinds:
        numbers = rng.random((1, len(GAZE_VALUES)))
        payloads = (
            BOTH.pack(numbers)[0][1],
            GazeTemplate(MONOCULAR_TOPICS[1], {1: CENTERS[1]}).pack(numbers)[0][1],
            msgpack.packb(binocular(timestamp=float(rng.random()))),
            msgpack.packb(swapped | {"timestamp": float(rng.random())}),
        )

        assert codec.decode_gaze(payloads[kind], THRESHOLD_01) == read(decoder, payloads[kind])


def test_layout_is_learnt_from_a_datum_of_two_eyes_only():
    numbers = np.full((1, len(GAZE_VALUES)), 0.5)
    single = GazeTemplate(MONOCULAR_TOPICS[0], {0: CENTERS[0]}).pack(numbers)[0][1]

    assert learn_layout(datum([0.5] * len(GAZE_VALUES))) is not None
    assert learn_layout(single) is None


def test_layout_whose_numbers_are_not_all_floats_is_not_learnt():
    assert learn_layout(msgpack.packb(binocular(confidence=1))) is None
    assert learn_layout(msgpack.packb(binocular(), use_single_float=True)) is None
    assert learn_layout(b"\xc1") is None
