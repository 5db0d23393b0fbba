"""Bytes of the armband's framed protocol: vectors worked out by hand, any chunking, any damage."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from visavis.devices.drivers.armband import codec
from visavis.devices.drivers.armband.dialect import Drive, FramedDialect

BYTES = st.integers(0, 255)
US = st.integers(0, 2**32 - 1)


def reference_crc(data):
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021) & 0xFFFF if crc & 0x8000 else crc << 1
    return crc


def test_crc_is_ccitt_false():
    assert codec.crc16(b"123456789") == 0x29B1


def test_stop_is_these_bytes():
    crc = reference_crc(bytes((4, 9)) + bytes(12))
    expected = bytes((0, 3, 4, 9)) + b"\x01" * 11 + bytes((3, crc & 255, crc >> 8, 0))

    assert codec.encode_stop(9) == expected
    assert codec.encode_stop(9).hex() == "00030409010101010101010101010103f61a00"


@pytest.mark.parametrize(
    ("encoded", "raw"),
    [
        (codec.encode_hello(1), "01 01 01" + "00" * 11),
        (
            codec.encode_set(2, 500, (255, 128, 0, 1), (0, 57, 126, 0)),
            "02 02 f401 ff00 8039 007e 0100 0000",
        ),
        (
            codec.encode_pattern(3, 1, 5, 255, 57, 126, modulation_dhz=100, duration_ms=2000),
            "03 03 05 01 ff 39 7e 6400 d007 000000",
        ),
        (codec.encode_ping(5, 3), "05 05 01 03" + "00" * 10),
        (codec.encode_ping(5, None), "05 05 00 00" + "00" * 10),
        (codec.encode_arm(6, True), "06 06 01" + "00" * 11),
    ],
)
def test_commands_carry_these_fields(encoded, raw):
    frame = codec.decode_frame(encoded[1:-1])

    assert bytes.fromhex(raw) == bytes((frame.kind, frame.seq)) + frame.payload
    assert codec.is_command(frame)
    assert 19 == len(encoded)


def test_answer_is_as_long_as_its_question():
    ack = codec.Acknowledgement(codec.SET, 2, 1, codec.OK, (1, 2, 3, 4), 3900, 25.0)
    assert len(codec.encode_set(2, 500, (1, 2, 3, 4))) == len(codec.encode_acknowledgement(ack))


acknowledgements = st.builds(
    codec.Acknowledgement,
    st.sampled_from((codec.SET, codec.PATTERN, codec.STOP, codec.PING, codec.ARM)),
    BYTES,
    US,
    st.integers(0, 5),
    st.tuples(*[BYTES] * 4),
    st.none() | st.integers(1, 65_535),
    st.none() | st.integers(-300, 300).map(float),
)
welcomes = st.builds(
    codec.Welcome,
    BYTES,
    BYTES,
    BYTES,
    st.tuples(BYTES, BYTES),
    st.integers(0, 65_535),
    st.text("ABC123", max_size=8),
    US,
    st.tuples(BYTES, BYTES),
    st.tuples(st.integers(0, 255).map(float), st.integers(0, 255).map(float)),
)
events = st.builds(codec.BandEvent, BYTES, BYTES, US, st.integers(-(2**15), 2**15 - 1))


def encode(answer):
    if isinstance(answer, codec.Welcome):
        return codec.encode_welcome(answer)
    if isinstance(answer, codec.BandEvent):
        return codec.encode_event(answer)
    return codec.encode_acknowledgement(answer)


@given(st.lists(acknowledgements | welcomes | events, max_size=8), st.data())
def test_answers_come_through_however_they_are_cut(answers, data):
    stream = b"".join(encode(answer) for answer in answers)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=12)))
    dialect = FramedDialect()
    heard = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        heard += dialect.feed(stream[start:end])

    assert answers == heard
    assert 0 == dialect.unreadable_count


@given(st.binary(max_size=44))
@example(b"\0" * 44)
def test_every_payload_survives_stuffing(payload):
    encoded = codec.encode_frame(7, 8, payload)

    assert encoded.count(0) == 1
    assert (7, 8, payload) == codec.decode_frame(encoded[:-1])


@given(st.binary(max_size=300), st.integers(1, 60))
def test_noise_never_raises_and_the_next_frame_after_a_zero_is_heard(noise, step):
    reader = codec.FrameReader()
    for at in range(0, len(noise), step):
        reader.feed(noise[at : at + step])
    frames = reader.feed(codec.encode_stop(77))

    assert (codec.STOP, 77, bytes(12)) == frames[-1]


@given(st.integers(1, 17), st.integers(1, 255), acknowledgements)
def test_one_changed_byte_is_always_found(at, flip, ack):
    stuffed = bytearray(codec.encode_acknowledgement(ack)[:-1])
    stuffed[at % len(stuffed)] ^= flip

    for piece in bytes(stuffed).split(b"\0"):
        assert codec.decode_frame(piece) is None


@pytest.mark.parametrize(
    "frame",
    [
        codec.Frame(codec.SET, 1, bytes(11)),
        codec.Frame(codec.SET, 1, bytes(13)),
        codec.Frame(codec.STOP, 1, bytes(11) + b"\1"),
        codec.Frame(9, 1, bytes(12)),
    ],
)
def test_wrong_length_padding_or_type_is_no_command(frame):
    assert not codec.is_command(frame)


def test_running_motor_never_rounds_to_off():
    encoded = FramedDialect().set(1, Drive((0.001, 0.0, 1.0, 0.5)), 100)
    _, amplitudes, _ = codec.decode_set(codec.decode_frame(encoded[1:-1]).payload)

    assert (1, 0, 255, 128) == amplitudes


def test_frame_too_long_for_the_band_is_refused():
    with pytest.raises(ValueError, match="at most 44 bytes"):
        codec.encode_frame(1, 1, bytes(45))
