"""What decodes the bytes of devices: one target per codec, with samples of its stored wires."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from benchmarks.fuzz.target import Target
from devices.drivers.armband.codec import (
    COMMAND_BYTES,
    PATTERN,
    SET,
    FrameReader,
    decode_answer,
    decode_pattern,
    decode_set,
)
from devices.drivers.bands.ascii_codec import AsciiLanguage, AsciiTemplates
from devices.drivers.bands.bhaptics_codec import BhapticsLanguage
from devices.drivers.bands.buzz_codec import BuzzLanguage
from devices.drivers.bands.report_codec import ReportLanguage, ReportLayout
from devices.drivers.bands.vhp_codec import VhpSleeveLanguage, VhpSlimLanguage
from devices.drivers.eyelink import codec as eyelink
from devices.drivers.fove import codec as fove
from devices.drivers.gazepoint import codec as gazepoint
from devices.drivers.hid_gaze import codec as hid_gaze
from devices.drivers.lsl import gaze_codec as lsl_gaze
from devices.drivers.lsl.body import read_layout
from devices.drivers.natnet import codec as natnet
from devices.drivers.neon import codec as neon
from devices.drivers.openvr import codec as openvr
from devices.drivers.pupil import codec as pupil
from devices.drivers.pupil.layout import GazeDecoder
from devices.drivers.sranipal import codec as sranipal
from devices.drivers.streaming.gaze_rays import Screen
from devices.drivers.triggers import labjack_codec as labjack
from devices.drivers.xsens import codec as xsens
from devices.streams import GAZE
from devices.wirelog import read_wire_log
from lab.errors import DataError, ProtocolViolation

WIRES = Path(__file__).resolve().parents[2] / "tests" / "wire"
SCREEN, SCREEN_PX, HALF_M = Screen(), (1920, 1080), 0.032


def frames(*wires: str) -> tuple[bytes, ...]:
    """Return every different frame that came over stored wires."""
    found: dict[bytes, None] = {}
    for wire in wires:
        log = read_wire_log(WIRES / f"{wire}.wire")
        for message in (*log.messages, *(answer for _, answer in log.exchanges)):
            found |= dict.fromkeys(message.frames)
    return tuple(found) or (bytes(8),)


def _armband(data: bytes) -> None:
    for frame in FrameReader().feed(data):
        decode_answer(frame)
        if frame.kind in (SET, PATTERN) and len(frame.payload) == COMMAND_BYTES:
            decode_set(frame.payload)
            decode_pattern(frame.payload)


def _feeding(language: Callable[[], object]) -> Callable[[bytes], object]:
    """Return a reader that cuts the bytes in two and feeds both to a new language."""

    def read(data: bytes) -> object:
        made = language()
        half = len(data) // 2
        return made.feed(data[:half]), made.feed(data[half:])  # type: ignore[attr-defined]

    return read


def _gazepoint(data: bytes) -> None:
    for line in gazepoint.LineReader().feed(data):
        gazepoint.decode_record(line.values, _PLACE, 1_000_000)
        gazepoint.calibration_errors_deg(line.values, SCREEN)


_PLACE = gazepoint.Place(SCREEN)


def _hid_gaze(samples: Sequence[bytes]) -> Callable[[bytes], object]:
    descriptor = max(samples, key=lambda raw: len(hid_gaze.walk_descriptor(raw)))
    layout = hid_gaze.tracking_layout(hid_gaze.walk_descriptor(descriptor))

    def read(data: bytes) -> None:
        found = hid_gaze.tracking_layout(hid_gaze.walk_descriptor(data))
        for each in (layout, found):
            if each is not None:
                hid_gaze.decode_report(data, each, SCREEN, 1e-6)

    return read


def _lsl_gaze(samples: Sequence[bytes]) -> Callable[[bytes], object]:
    known = [i for i in map(lsl_gaze.parse_info, samples) if i is not None]
    layouts = [found for found in map(lsl_gaze.layout_of, known) if found is not None]

    def read(data: bytes) -> None:
        info = lsl_gaze.parse_info(data)
        if info is not None:
            lsl_gaze.layout_of(info)
        for layout in layouts:
            size = 8 * (layout.count + 1)
            lsl_gaze.decode_sample(data[:size].ljust(size, b"\x01"), layout, SCREEN, HALF_M)

    return read


def _natnet(data: bytes) -> None:
    _, payload = natnet.split(natnet.encode(7, data[4:]))
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
    camera = next(found for found in cameras if found is not None)[0]

    def read(data: bytes) -> None:
        neon.decode_calibration(data, 12.0)
        neon.decode_gaze(0, 1, data, camera)

    return read


def _openvr(data: bytes) -> None:
    for pose in openvr.decode_poses(data)[:2]:
        openvr.decode_pose(pose)
    openvr.decode_event(data)
    openvr.decode_frame_timing(data)


def _pupil() -> Callable[[bytes], object]:
    decoder = GazeDecoder(0.6)
    rows, stamps_ns = np.zeros(GAZE.dtype.itemsize, np.uint8), np.zeros(1, np.int64)

    def read(data: bytes) -> None:
        pupil.decode_gaze(data, 0.6)
        decoder.decode(data, rows, stamps_ns, 0)
        pupil.decode_notification(data)
        pupil.decode_time((data,))
        pupil.decode_version(data.decode("latin-1"))

    return read


def _xsens() -> Callable[[bytes], object]:
    assembler = xsens.Assembler()

    def read(data: bytes) -> None:
        found = xsens.decode_datagram(data)
        if isinstance(found, xsens.Datagram):
            assembler.add(found)

    return read


def _xml(data: bytes) -> object:
    try:
        return read_layout(data)
    except ProtocolViolation:
        return None


def codecs() -> Iterator[Target]:
    """Yield a target per codec; a codec answers nonsense with None or less, and never raises."""
    hid, lsl, neon_frames = frames("hid_gaze"), frames("lsl_gaze", "tobii_lsl"), frames("neon")
    ascii_bands = AsciiTemplates(
        set_one="M{motor} {amplitude}\n", stop="S\n", battery_answer=r"BAT (\d+)"
    )
    screen = (SCREEN, SCREEN_PX, HALF_M, 0.01)
    languages: dict[str, tuple[Callable[[], object], str]] = {
        "ascii_codec": (lambda: AsciiLanguage(ascii_bands), "ascii_armband"),
        "bhaptics_codec": (BhapticsLanguage, "bhaptics"),
        "buzz_codec": (BuzzLanguage, "neosensory_buzz"),
        "report_codec": (lambda: ReportLanguage(ReportLayout(battery_byte=3)), "hid_armband"),
        "vhp_codec sleeve": (VhpSleeveLanguage, "vhp_sleeve"),
        "vhp_codec slim": (VhpSlimLanguage, "vhp_sleeve"),
    }
    for name, (language, wire) in languages.items():
        yield Target(f"bands.{name}", frames(wire), _feeding(language))
    yield Target("armband.codec", frames("serial_armband", "ble_armband"), _armband)
    yield Target("eyelink.codec", frames("eyelink"), lambda b: eyelink.decode_sample(b, *screen))
    yield Target("fove.codec", frames("fove"), lambda b: fove.decode_eye_frame(b, 0.064))
    yield Target("gazepoint.codec", frames("gazepoint"), _gazepoint)
    yield Target("hid_gaze.codec", hid, _hid_gaze(hid))
    yield Target("lsl.gaze_codec", lsl, _lsl_gaze(lsl))
    yield Target("lsl.body", frames("lsl_body"), _xml)
    yield Target("natnet.codec", frames("natnet"), _natnet)
    yield Target("neon.codec", neon_frames, _neon(neon_frames))
    yield Target("openvr.codec", frames("openvr_headset", "openvr_trackers"), _openvr)
    yield Target("pupil.codec", frames("pupil_core"), _pupil())
    yield Target("sranipal.codec", frames("vive_pro_eye"), sranipal.decode_eye_data)
    yield Target(
        "triggers.labjack_codec",
        frames("labjack_triggers"),
        lambda b: list(labjack.AnswerReader().feed(b)),
    )
    yield Target("xsens.codec", frames("xsens"), _xsens())
