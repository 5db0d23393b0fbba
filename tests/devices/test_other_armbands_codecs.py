"""Bytes of the other armbands: vectors from the cited sources, any chunking, noise."""

import base64
import json
import struct
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.devices.other_band_rigs import COMMANDS
from visavis.devices.drivers.bands import bhaptics_codec, buzz_codec, vhp_codec
from visavis.devices.drivers.bands.ascii_codec import AsciiLanguage, AsciiTemplates
from visavis.devices.drivers.bands.language import Condition, JsonReader, Ready, Refusal, level
from visavis.devices.drivers.bands.report_codec import ReportLanguage, ReportLayout
from visavis.devices.sim.bands import vhp as vhp_sim

amplitudes = st.lists(st.floats(0, 1), min_size=4, max_size=4)


def chunked(data, cuts):
    at = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    return [data[a:b] for a, b in pairwise(at)]


# ---- Buzz: neosensory-sdk-for-python, vibrate_motors and the order of its methods ------------


def test_buzz_vibrate_is_the_sdk_line():
    assert buzz_codec.vibrate([255, 0, 0, 0]) == b'motors vibrate "/wAAAA=="\r\n'


def test_buzz_opening_authorises_before_it_touches_the_motors():
    lines = b"".join(buzz_codec.BuzzLanguage().opening()).decode().split("\r\n")

    wanted = ["auth as developer", "accept", "audio stop", "motors clear_queue", "motors start"]
    assert wanted == [line for line in lines if line in wanted]


BUZZ_SAYS = (
    b'device battery_soc\r\n{"status_code": 200, "data": {"battery_soc": 57}}\r\nble_cli:~$ '
    b'motors start\r\n{"status_code": 200, "message": "a } brace"}\r\nble_cli:~$ '
    b'accept\r\n{"status_code": 400, "message": "no"}\r\nble_cli:~$ '
)


@given(cuts=st.lists(st.integers(0, 300), max_size=12))
def test_buzz_answers_read_alike_in_any_chunks(cuts):
    language = buzz_codec.BuzzLanguage()

    notices = [n for piece in chunked(BUZZ_SAYS, cuts) for n in language.feed(piece)]

    kinds = [type(notice) for notice in notices]
    assert kinds == [Condition, Ready, Refusal]
    assert notices[0].battery_01 == 0.57
    assert language.unreadable_count == 0


@given(noise=st.binary(max_size=400))
def test_buzz_recovers_at_the_next_prompt_after_noise(noise):
    language = buzz_codec.BuzzLanguage()
    language.feed(noise + b"\r\nble_cli:~$ ")

    assert [type(n) for n in language.feed(BUZZ_SAYS)] == [Condition, Ready, Refusal]


def test_object_without_end_is_given_up_at_the_limit():
    reader = JsonReader()

    for _ in range(40):
        assert reader.feed(b'{"a": [' * 100) == []
    assert reader.unreadable_count > 0
    reader.reset()
    assert reader.feed(b'x{"a": 1}') == [("x", {"a": 1})]


# ---- VHP: google/audio-to-tactile, message.cpp, tactile_pattern.h ------------------------------


@pytest.mark.parametrize(
    ("kind", "payload", "expected"),
    [(14, b"", "0f1e0e00"), (36, b"\x00", "2671240100"), (19, b"5", "4a73130135")],
)
def test_ble_message_bears_a_fletcher_checksum_that_starts_at_one(kind, payload, expected):
    assert vhp_codec.encode_ble(kind, payload).hex() == expected


def test_serial_message_names_start_and_recipient():
    assert vhp_codec.encode_serial(14) == bytes((0xC8, 3, 14, 0))
    assert vhp_codec.encode_serial(15, recipient=4) == bytes((0xC8, 4, 15, 0))


def test_pattern_is_the_one_of_the_header_file():
    ops = vhp_codec.ex_pattern([1.0], [1], [9], 100)

    # gains to 0, gain 1.0 on channel 1, tone 125 Hz, play 100 ms (0x80 + (100 - 10) / 20), end
    assert ops.hex(" ") == "02 00 b1 ff a1 09 84 00"


@given(levels=amplitudes, ttl_ms=st.integers(1, 10_000))
def test_pattern_fits_a_message_and_lasts_its_time_to_live(levels, ttl_ms):
    language = vhp_codec.VhpSlimLanguage()
    (message,) = language.drive(levels, ttl_ms)

    payload = message[4:]
    assert len(payload) <= 128
    assert payload[-1] == 0
    played_ms = sum(((op & 31) + 1) * 20 for op in _play_ops(payload))
    lasts_ms = language.lasts_ms(ttl_ms)
    assert lasts_ms == min(ttl_ms, 8320)
    assert played_ms >= lasts_ms
    assert played_ms < ttl_ms + 20


def _play_ops(ops):
    i = 0
    while ops[i]:
        wide = ops[i] & 0xE0 != 0x80
        if not wide:
            yield ops[i]
        i += 1 + wide


def test_sleeve_buffer_is_interleaved_and_idle_tactors_hold_zeros():
    buffer = vhp_codec.sleeve_samples([1.0, 0.0], [5, 7])

    assert len(buffer) == 96
    assert list(buffer[5::12]) == [128, 218, 255, 218, 128, 38, 1, 38]
    assert not any(buffer[c + 12 * i] for c in range(12) if c != 5 for i in range(8))
    assert vhp_codec.SLEEVE_RATE_HZ == pytest.approx(244.14, abs=0.01)


vhp_messages = st.tuples(st.integers(1, 36).filter(lambda k: k != 23), st.binary(max_size=128))


@given(messages=st.lists(vhp_messages, max_size=6), cuts=st.lists(st.integers(0, 900), max_size=9))
@pytest.mark.parametrize("has_checksum", [True, False])
def test_vhp_messages_come_back_in_any_chunks(has_checksum, messages, cuts):
    encode = vhp_codec.encode_ble if has_checksum else vhp_codec.encode_serial
    reader = vhp_codec.VhpReader(has_checksum=has_checksum)
    data = b"".join(encode(kind, payload) for kind, payload in messages)

    read = [m for piece in chunked(data, cuts) for m in reader.feed(piece)]

    assert messages == [(m.kind, m.payload) for m in read]
    assert reader.unreadable_count == 0


@settings(max_examples=200)
@given(noise=st.binary(max_size=300))
def test_checked_message_after_noise_is_found(noise):
    reader = vhp_codec.VhpReader(has_checksum=True)
    reader.feed(noise)
    reader.feed(bytes(140))  # ends whatever the noise began

    message = vhp_codec.encode_ble(28, struct.pack("<f", 3.7))
    found = reader.feed(message)
    if not found:  # the noise ended in a header that swallowed the message; the next one comes
        found = reader.feed(bytes(140) + message)
    assert (28, struct.pack("<f", 3.7)) in [(m.kind, m.payload) for m in found]


def test_fletcher_of_driver_and_simulator_agree_on_every_pattern():
    for seed in range(50):
        data = bytes((seed * 37 + i * 11) % 256 for i in range(seed + 1))
        assert vhp_codec.fletcher16(data) == vhp_sim._fletcher(data)


# ---- bHaptics: tact-python v1, submit_dot -------------------------------------------------------


def test_bhaptics_frame_is_the_one_of_tact_python():
    language = bhaptics_codec.BhapticsLanguage("ForearmR", (0, 5))
    (message,) = language.drive((1.0, 0.25), 5000)

    assert json.loads(message) == {
        "Submit": [
            {
                "Type": "frame",
                "Key": "visavis ForearmR",
                "Frame": {
                    "position": "ForearmR",
                    "dotPoints": [{"index": 0, "intensity": 100}, {"index": 5, "intensity": 25}],
                    "durationMillis": 100,
                },
            }
        ]
    }


# ---- texts and reports ---------------------------------------------------------------------------


def test_text_of_each_motor_and_of_all():
    one = AsciiLanguage(AsciiTemplates(set_one="M{motor:02d}={amplitude}\n", first_motor=1))
    every = AsciiLanguage(
        AsciiTemplates(set_all="{a0},{a1},{a2},{a3};{ttl_ms}\r\n", full_scale=100)
    )

    assert one.drive((1, 0, 0.5, 0), 9) == (b"M01=255\nM02=0\nM03=128\nM04=0\n",)
    assert every.drive((1, 0, 0.5, 0), 90) == (b"100,0,50,0;90\r\n",)
    assert every.silence() == (b"0,0,0,0;0\r\n",)


@given(data=st.binary(max_size=600), cuts=st.lists(st.integers(0, 600), max_size=9))
def test_no_bytes_disturb_a_language(data, cuts):
    languages = [
        AsciiLanguage(AsciiTemplates(**COMMANDS)),
        ReportLanguage(ReportLayout(battery_byte=1)),
        buzz_codec.BuzzLanguage(),
        bhaptics_codec.BhapticsLanguage(),
        vhp_codec.VhpSleeveLanguage(),
        vhp_codec.VhpSlimLanguage(),
    ]
    for language in languages:
        for piece in chunked(data, cuts):
            for notice in language.feed(piece):
                if isinstance(notice, Condition) and notice.battery_01 is not None:
                    assert 0 <= notice.battery_01 <= 1


def test_report_holds_prefix_motors_and_time_to_live():
    layout = ReportLayout(report_id=2, prefix=b"\xa5", first_motor_byte=2, ttl_byte=7)
    language = ReportLanguage(layout)

    assert language.drive((1, 0.5, 0, 1), 305)[0].hex() == "02" + "a500" + "ff8000ff" + "00" + "1f"
    assert language.silence()[0].hex() == "02" + "a500" + "00000000" + "0000"
    assert language.lasts_ms(9000) == 2550


@given(amplitude=st.floats(0, 1), full=st.integers(1, 65535))
def test_running_motor_never_rounds_to_off(amplitude, full):
    assert (level(amplitude, full) > 0) == (amplitude > 0)
    assert level(amplitude, full) <= full


@given(levels=amplitudes)
def test_buzz_bytes_decode_to_the_levels(levels):
    (line,) = buzz_codec.BuzzLanguage().drive(levels, 100)
    inside = line.decode().split('"')[1]

    assert list(base64.b64decode(inside)) == [level(a, 255) for a in levels]
