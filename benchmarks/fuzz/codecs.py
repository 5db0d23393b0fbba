"""What decodes the bytes of devices: one target per codec, with samples of its stored wires.

A codec is also held to what its results may be: gaze has unit rays and pupils of an eye's size,
presses have names and levels the device has, a checked frame of the board says what was sent.
"""

import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from benchmarks.fuzz.target import Target
from visavis.devices.drivers.armband.codec import (
    COMMAND_BYTES,
    PATTERN,
    SET,
    FrameReader,
    decode_answer,
    decode_pattern,
    decode_set,
)
from visavis.devices.drivers.bands.ascii_codec import AsciiLanguage, AsciiTemplates
from visavis.devices.drivers.bands.bhaptics_codec import BhapticsLanguage
from visavis.devices.drivers.bands.bhaptics_sdk_codec import BhapticsSdkLanguage
from visavis.devices.drivers.bands.buzz_codec import BuzzLanguage
from visavis.devices.drivers.bands.report_codec import ReportLanguage, ReportLayout
from visavis.devices.drivers.bands.vhp_codec import VhpSleeveLanguage, VhpSlimLanguage
from visavis.devices.drivers.ble_sensor.codec import read_heart_rate, read_polar_ecg
from visavis.devices.drivers.buttons.codes import ByteButtons
from visavis.devices.drivers.buttons.device import Press
from visavis.devices.drivers.buttons.hid_reports import ReportReader, layout_of
from visavis.devices.drivers.buttons.keyboard import Keyboard, KeyLink
from visavis.devices.drivers.buttons.xid import BUTTONS, XidReader
from visavis.devices.drivers.eyelink import codec as eyelink
from visavis.devices.drivers.eyelink.spec import PupilScale
from visavis.devices.drivers.fove import codec as fove
from visavis.devices.drivers.gazepoint import codec as gazepoint
from visavis.devices.drivers.hid_gaze import codec as hid_gaze
from visavis.devices.drivers.lsl import gaze_codec as lsl_gaze
from visavis.devices.drivers.lsl.body import read_layout
from visavis.devices.drivers.natnet import codec as natnet
from visavis.devices.drivers.neon import codec as neon
from visavis.devices.drivers.openvr import codec as openvr
from visavis.devices.drivers.pupil import codec as pupil
from visavis.devices.drivers.pupil.layout import GazeDecoder
from visavis.devices.drivers.qualisys import codec as qualisys
from visavis.devices.drivers.sranipal import codec as sranipal
from visavis.devices.drivers.streaming.gaze_rays import Sample
from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.drivers.triggers import labjack_codec as labjack
from visavis.devices.drivers.varjo import codec as varjo
from visavis.devices.drivers.vicon import codec as vicon
from visavis.devices.drivers.xsens import codec as xsens
from visavis.devices.registry import driver_wiring
from visavis.devices.streams import GAZE
from visavis.devices.sync import board_codec as board
from visavis.devices.wirelog import read_wire_log
from visavis.lab.clock import SimClock
from visavis.lab.errors import DataError, ProtocolViolation

WIRES = Path(__file__).resolve().parents[2] / "tests" / "wire"
SCREEN, SCREEN_PX, HALF_M = Screen(), (1920, 1080), 0.032


def frames(*wires: str) -> tuple[bytes, ...]:
    """Return every different frame that came over stored wires."""
    encoded: dict[bytes, None] = {}
    for wire in wires:
        log = read_wire_log(WIRES / f"{wire}.wire")
        heard = (*(m.frames for m in log.messages), *(answer.frames for _, answer in log.exchanges))
        for parts in heard:
            encoded |= dict.fromkeys(parts)
    return tuple(encoded) or (bytes(8),)


def _armband(data: bytes) -> list[object]:
    said: list[object] = []
    for frame in FrameReader().feed(data):
        said.append(decode_answer(frame))
        if frame.kind in (SET, PATTERN) and len(frame.payload) == COMMAND_BYTES:
            decode_set(frame.payload)
            decode_pattern(frame.payload)
    return said


def _whole(wire: str) -> tuple[bytes, ...]:
    """Return the frames that came over a stored wire in pieces, each between two zeros."""
    log = read_wire_log(WIRES / f"{wire}.wire")
    heard = b"".join(frame for message in log.messages for frame in message.frames)
    return tuple({b"\0" + piece + b"\0": None for piece in heard.split(b"\0") if piece})


def _board(data: bytes) -> list[tuple[object, ...]]:
    return [_board_said(board.decode(frame)) for frame in FrameReader().feed(data)]


def _board_said(found: board.Samples | board.BoardTime | None) -> tuple[object, ...]:
    match found:
        case board.Samples():
            return (found.seq, found.device_us, found.period_us, found.levels.tobytes())
        case board.BoardTime():
            return (found.seq, found.device_us)
        case _:
            return ()


def _labjack(data: bytes) -> list[int]:
    return list(labjack.AnswerReader().feed(data))


def _boards_frames() -> tuple[bytes, ...]:
    """Return frames of the board, each between two zeros, as its firmware sends them."""
    rng = np.random.default_rng(16)
    encoded = [board.encode_time(board.BoardTime(k, k * 9_999_991 % 2**32)) for k in range(32)]
    for k in range(96):
        levels = rng.integers(0, 256, (board.BLOCK, len(board.CHANNELS))).astype(np.uint8)
        told = board.Samples(k, k * 44_444_443 % 2**32, 250, levels)
        encoded.append(board.encode_samples(told))
    return tuple(b"\0" + frame for frame in encoded)


def only_said_by(
    samples: Sequence[bytes], read: Callable[[bytes], Iterable[object]]
) -> Callable[[object], bool]:
    """Return whether everything that was read stands in a whole sample, or is nothing."""
    whole = {said for sample in samples for said in read(sample)} | {None, ()}

    def is_sound(found: object) -> bool:
        return isinstance(found, Iterable) and all(said in whole for said in found)

    return is_sound


def _feeding(language: Callable[[], object]) -> Callable[[bytes], object]:
    """Return a reader that cuts the bytes in two and feeds both to a new language."""

    def read(data: bytes) -> object:
        made = language()
        half = len(data) // 2
        return made.feed(data[:half]), made.feed(data[half:])  # type: ignore[attr-defined]

    return read


def _gazepoint(data: bytes) -> list[object]:
    encoded: list[object] = []
    for line in gazepoint.LineReader().feed(data):
        encoded.append(gazepoint.decode_record(line.values, _PLACE, 1_000_000))
        gazepoint.calibration_errors_deg(line.values, SCREEN)
    return encoded


_PLACE = gazepoint.Place(SCREEN)


def _hid_gaze(samples: Sequence[bytes]) -> Callable[[bytes], object]:
    descriptor = max(samples, key=lambda raw: len(hid_gaze.walk_descriptor(raw)))
    layout = hid_gaze.tracking_layout(hid_gaze.walk_descriptor(descriptor))

    def read(data: bytes) -> list[object]:
        encoded = hid_gaze.tracking_layout(hid_gaze.walk_descriptor(data))
        layouts = [each for each in (layout, encoded) if each is not None]
        return [hid_gaze.decode_report(data, each, SCREEN, 1e-6) for each in layouts]

    return read


def _lsl_gaze(samples: Sequence[bytes]) -> Callable[[bytes], object]:
    known = [i for i in map(lsl_gaze.parse_info, samples) if i is not None]
    layouts = [encoded for encoded in map(lsl_gaze.layout_of, known) if encoded is not None]

    def read(data: bytes) -> list[object]:
        info = lsl_gaze.parse_info(data)
        if info is not None:
            lsl_gaze.layout_of(info)
        encoded: list[object] = []
        for layout in layouts:
            size = 8 * (layout.count + 1)
            raw = data[:size].ljust(size, b"\x01")
            encoded.append(lsl_gaze.decode_sample(raw, layout, SCREEN, HALF_M))
        return encoded

    return read


def _notified(data: bytes) -> None:
    for read in (read_heart_rate, read_polar_ecg):
        try:
            read(data)
        except DataError:
            continue


def _qualisys(data: bytes) -> None:
    for _, payload in qualisys.PacketReader().feed(data):
        for read in (
            qualisys.decode_frame,
            lambda b: qualisys.decode_settings(qualisys.text_of(b)),
        ):
            try:
                read(payload)
            except DataError:
                continue


def _natnet(data: bytes) -> None:
    _, payload = natnet.split_message(natnet.encode(7, data[4:]))
    for decode in (natnet.decode_server, *_NATNET):
        try:
            decode(payload)
        except DataError:
            continue


_NATNET = tuple(
    decode
    for version in ((3, 0), (3, 1), (4, 0), (4, 1), (4, 2))
    for decode in (
        lambda payload, v=version: natnet.decode_models(payload, v),
        lambda payload, v=version: natnet.decode_frame(payload, v),
    )
)


def _neon(samples: Sequence[bytes]) -> Callable[[bytes], object]:
    cameras = (neon.decode_calibration(raw, 0.0) for raw in samples)
    camera = next(encoded for encoded in cameras if encoded is not None)[0]

    def read(data: bytes) -> object:
        neon.decode_calibration(data, 12.0)
        return neon.decode_gaze(0, 1, data, camera)

    return read


def _openvr(data: bytes) -> None:
    for pose in openvr.decode_poses(data)[:2]:
        openvr.decode_pose(pose)
    openvr.decode_event(data)
    openvr.decode_frame_timing(data)


def _pupil() -> Callable[[bytes], object]:
    decoder = GazeDecoder(0.6)
    rows, stamps_ns = np.zeros(GAZE.dtype.itemsize, np.uint8), np.zeros(1, np.int64)

    def read(data: bytes) -> list[object]:
        encoded = pupil.decode_gaze(data, 0.6)
        is_read = decoder.decode(data, rows, stamps_ns, 0)
        pupil.decode_notification(data)
        pupil.decode_time((data,))
        pupil.decode_version(data.decode("latin-1"))
        short = [Sample(int(stamps_ns[0]), None, rows.tobytes())] if is_read else []
        return [*short, *([] if encoded is None else [Sample(encoded[0], None, encoded[1])])]

    return read


def _xsens() -> Callable[[bytes], object]:
    assembler = xsens.Assembler()

    def read(data: bytes) -> None:
        encoded = xsens.decode_datagram(data)
        if isinstance(encoded, xsens.Datagram):
            assembler.add(encoded)

    return read


def _xml(data: bytes) -> object:
    try:
        return read_layout(data)
    except ProtocolViolation:
        return None


def _presses_of(driver: str) -> Callable[[bytes], object]:
    """Return a reader of a box's bytes by its driver, every time from the start."""
    device = driver_wiring(driver).on_wire("responses", SimClock(), KeyLink(SimClock()))
    assert isinstance(device, ByteButtons | Keyboard)

    def read(data: bytes) -> list[Press]:
        device._fresh()  # noqa: SLF001 - what a driver does when its wire begins anew
        half = len(data) // 2
        return [*device._read(data[:half]), *device._read(data[half:])]  # noqa: SLF001

    return read


def _hid_buttons(samples: Sequence[bytes]) -> Callable[[bytes], object]:
    descriptor = max(samples, key=lambda raw: len(layout_of(raw).controls))
    known = layout_of(descriptor)

    def read(data: bytes) -> list[Press]:
        return [p for one in (known, layout_of(data)) for p in ReportReader(one).feed(data)]

    return read


def _of_buttons(names: Iterable[str] | None) -> Callable[[object], bool]:
    """Return whether presses have a name the device has (None: any), a level and a time."""
    known = None if names is None else frozenset(names)

    def is_sound(found: object) -> bool:
        return isinstance(found, list) and all(
            (known is None or press.button in known)
            and 0.0 <= press.value_01 <= 1.0
            and (press.t_device_ns is None or press.t_device_ns >= 0)
            for press in found
        )

    return is_sound


def gaze_is_sound(found: object) -> bool:
    """Tell whether every gaze sample in a result is one: unit rays or none, pupils of an eye."""
    if isinstance(found, Sample):
        return _row_is_sound(found.row)
    if isinstance(found, tuple | list):
        return all(map(gaze_is_sound, found))
    return True


def _row_is_sound(row: bytes) -> bool:
    x, y, z, *place, valid, used, _, lx, ly, lz, left, left_mm, rx, ry, rz, right, right_mm = (
        GAZE_ROW.unpack(row)
    )
    rays = ((x, y, z, valid), (lx, ly, lz, left), (rx, ry, rz, right))
    return (
        all(_is_ray(*ray) for ray in rays)
        and all(mm != mm or 0 < mm < 20 for mm in (left_mm, right_mm))
        and all(at != at or abs(at) <= 1001 for at in place)
        and used <= 3
    )


def _is_ray(x: float, y: float, z: float, valid: bool) -> bool:
    if x != x or y != y or z != z:
        return not valid
    return abs(x * x + y * y + z * z - 1) < 1e-5


GAZE_ROW = struct.Struct("<6f?Bf3f?f3f?f")
"""A row of `GAZE.dtype`."""
assert GAZE_ROW.size == GAZE.dtype.itemsize


def codecs() -> Iterator[Target]:
    """Yield a target per codec; a codec answers nonsense with None or less, and never raises."""
    hid, lsl, neon_frames = frames("hid_gaze"), frames("lsl_gaze", "tobii_lsl"), frames("neon")
    ascii_bands = AsciiTemplates(
        set_one="M{motor} {amplitude}\n", stop="S\n", battery_answer=r"BAT (\d+)"
    )
    screen = (SCREEN, SCREEN_PX, HALF_M, PupilScale(5.0, 4000.0, is_area=True))
    languages: dict[str, tuple[Callable[[], object], str]] = {
        "ascii_codec": (lambda: AsciiLanguage(ascii_bands), "ascii_armband"),
        "bhaptics_codec": (BhapticsLanguage, "bhaptics"),
        "bhaptics_sdk_codec": (BhapticsSdkLanguage, "bhaptics_sdk"),
        "buzz_codec": (BuzzLanguage, "neosensory_buzz"),
        "report_codec": (lambda: ReportLanguage(ReportLayout(battery_byte=3)), "hid_armband"),
        "vhp_codec sleeve": (VhpSleeveLanguage, "vhp_sleeve"),
        "vhp_codec slim": (VhpSlimLanguage, "vhp_sleeve"),
    }
    for name, (language, wire) in languages.items():
        yield Target(f"bands.{name}", frames(wire), _feeding(language))
    bands = (*_whole("serial_armband"), *_whole("ble_armband"))
    yield Target(
        "armband.codec", bands, _armband, is_sound=only_said_by(bands, _armband), checksum_bits=16
    )
    boards = _boards_frames()
    yield Target(
        "sync.board_codec", boards, _board, is_sound=only_said_by(boards, _board), checksum_bits=32
    )
    pads, boxes, pressed = (frames(w) for w in ("xid_buttons", "byte_buttons", "hid_buttons"))
    yield Target("buttons.xid", pads, lambda b: XidReader().feed(b), is_sound=_of_buttons(BUTTONS))
    yield Target("buttons.codes", boxes, _presses_of("byte_buttons"), is_sound=_of_buttons("1234"))
    yield Target(
        "buttons.hid_reports",
        tuple(raw[1:] for raw in pressed if raw[:1] in b"DR"),
        _hid_buttons([raw[1:] for raw in pressed]),
        is_sound=_of_buttons(None),
    )
    yield Target(
        "buttons.keyboard", frames("keyboard"), _presses_of("keyboard"), is_sound=_of_buttons(None)
    )
    for name, sample_frames, read in (
        ("eyelink.codec", frames("eyelink"), lambda b: eyelink.decode_sample(b, *screen)),
        ("fove.codec", frames("fove"), lambda b: fove.decode_eye_frame(b, 0.064)),
        ("gazepoint.codec", frames("gazepoint"), _gazepoint),
        ("hid_gaze.codec", hid, _hid_gaze(hid)),
        ("lsl.gaze_codec", lsl, _lsl_gaze(lsl)),
        ("neon.codec", neon_frames, _neon(neon_frames)),
        ("pupil.codec", frames("pupil_core"), _pupil()),
        ("sranipal.codec", frames("vive_pro_eye"), sranipal.decode_eye_data),
        ("varjo.codec", frames("varjo"), varjo.decode_datum),
    ):
        yield Target(name, sample_frames, read, is_sound=gaze_is_sound)
    yield Target("ble_sensor.codec", frames("ble_sensor"), _notified)
    yield Target("lsl.body", frames("lsl_body"), _xml)
    yield Target("natnet.codec", frames("natnet"), _natnet)
    yield Target("openvr.codec", frames("openvr_headset", "openvr_trackers"), _openvr)
    yield Target("qualisys.codec", frames("qualisys"), _qualisys)
    yield Target("vicon.codec", frames("vicon"), vicon.decode, (DataError,))
    jacks = frames("labjack_triggers")
    yield Target(
        "triggers.labjack_codec",
        jacks,
        _labjack,
        is_sound=only_said_by(jacks, _labjack),
        checksum_bits=8 + 10,  # a sum of one byte, and one of four bytes, which fills ten bits
    )
    yield Target("xsens.codec", frames("xsens"), _xsens())
