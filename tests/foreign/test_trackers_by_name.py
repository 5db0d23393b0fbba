"""Eye trackers by name: the same gaze, written as each program does, is read as the same gaze."""

import gzip
import json
import re
from collections.abc import Callable
from pathlib import Path

import mne
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.analysis.gaze.streams import stamps
from tests.foreign.test_gaze_files import looking
from visavis.analysis.gaze.import_report import FORMATS, Format, prepare, quality_table, read_gaze
from visavis.lab.errors import DataError, UsageError
from visavis.lab.geometry import Vector, angle_deg, direction_from_yaw_pitch_deg
from visavis.lab.screen import FlatScreen

SCREEN = FlatScreen(0.53, 0.30, 1920, 1080, 0.65)
N = 240
DEGREES = looking(N)
GAZE = direction_from_yaw_pitch_deg(-DEGREES[:, 0], DEGREES[:, 1])
PIXELS = SCREEN.pixels_of(SCREEN.meets_m(np.zeros((N, 3)), GAZE))
LOST = np.arange(N) % 60 < 4
Writer = Callable[[Path], Path]


def text_file(path: Path, lines: list[str]) -> Path:
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def tobii(folder: Path, decimal: str = ".", microseconds: bool = True) -> Path:
    head = "Recording timestamp\tSensor\tGaze point left X\tGaze point left Y\tGaze point right X"
    head += "\tGaze point right Y\tPupil diameter left\tPupil diameter right"
    lines = [f"{head}\tValidity left\tValidity right"]
    for k, t_ns in enumerate(stamps(N).tolist()):
        t = round(t_ns / 1e3) if microseconds else t_ns / 1e6
        x, y = ["", ""] if LOST[k] else [f"{v:.4f}" for v in PIXELS[k]]
        word = "Invalid" if LOST[k] else "Valid"
        cells = [str(t), "Eye Tracker", x, y, x, y, "3.1", "3.2", word, word]
        lines.append("\t".join(cells).replace(".", decimal))
        lines.append("\t".join([str(t + 1).replace(".", decimal), "Mouse", *[""] * 8]))
    return text_file(folder / "tobii.tsv", lines)


def neon(folder: Path) -> Path:
    lines = [
        "section id,recording id,timestamp [ns],gaze x [px],gaze y [px],worn,"
        "fixation id,blink id,azimuth [deg],elevation [deg]"
    ]
    for k, t_ns in enumerate(stamps(N).tolist()):
        az, el = DEGREES[k]
        lines.append(f"a,b,{1_700_000_000_000_000_000 + t_ns},1,1,{int(not LOST[k])},,,{az},{el}")
    return text_file(folder / "gaze.csv", lines)


def gazepoint(folder: Path) -> Path:
    columns = "LPOGX,LPOGY,LPOGV,RPOGX,RPOGY,RPOGV,BPOGX,BPOGY,BPOGV,LPMM,RPMM"
    lines = [f"MEDIA_ID,CNT,TIME(2024/01/02 03:04:05.678),{columns}"]
    for k, t_ns in enumerate(stamps(N).tolist()):
        x, y = PIXELS[k] / [1920, 1080]
        point = f"{x},{y},{int(not LOST[k])}"
        lines.append(f"0,{k},{t_ns / 1e9:.6f},{point},{point},{point},3.1,3.2")
    return text_file(folder / "all_gaze.csv", lines)


def varjo(folder: Path) -> Path:
    names = [f"{eye}_forward_{c}" for eye in ("gaze", "left", "right") for c in "xyz"]
    lines = [",".join(["raw_timestamp", *names, "status", "left_status", "right_status"])]
    theirs = GAZE * [1, 1, -1]
    for k, t_ns in enumerate(stamps(N).tolist()):
        x, y, z = theirs[k]
        codes = ["0"] * 3 if LOST[k] else ["2", "3", "2"]
        lines.append(",".join([str(10**15 + t_ns), *[f"{x},{y},{z}"] * 3, *codes]))
    return text_file(folder / "varjo.csv", lines)


def gazebase(folder: Path) -> Path:
    lines = ["n,x,y,val,xP,yP,lab,dP"]
    for k in range(N):
        x, y = ("NaN", "NaN") if LOST[k] else DEGREES[k]
        lines.append(f"{k},{x},{y},{4 if LOST[k] else 0},NaN,NaN,0,900")
    return text_file(folder / "S_1002_S1_TEX.csv", lines)


def smi(folder: Path) -> Path:
    lines = [
        "## [iView]",
        "## Sample Rate:\t120",
        "## Calibration Area:\t1920\t1080",
        "## Stimulus Dimension [mm]:\t530\t300",
        "## Head Distance [mm]:\t650",
        "Time\tType\tTrial\tL POR X [px]\tL POR Y [px]\tR POR X [px]\tR POR Y [px]",
    ]
    for k, t_ns in enumerate(stamps(N).tolist()):
        x, y = (0.0, 0.0) if LOST[k] else PIXELS[k]
        lines.append(f"{8_000_000 + t_ns // 1000}\tSMP\t1\t{x}\t{y}\t{x}\t{y}")
        if k % 50 == 0:
            lines.append(f"{8_000_000 + t_ns // 1000}\tMSG\t1\t# Message: picture.jpg")
    return text_file(folder / "smi.txt", lines)


def glasses3(folder: Path) -> Path:
    theirs = GAZE * [-1, 1, -1]
    lines = []
    for k, t_ns in enumerate(stamps(N).tolist()):
        eye = {"gazeorigin": [0, 0, 0], "gazedirection": theirs[k].tolist(), "pupildiameter": 3.1}
        data = {} if LOST[k] else {"gaze2d": [0.5, 0.5], "eyeleft": eye, "eyeright": eye}
        lines.append(json.dumps({"type": "gaze", "timestamp": t_ns / 1e9, "data": data}))
    path = folder / "gazedata.gz"
    path.write_bytes(gzip.compress(("\n".join(lines) + "\n").encode()))
    return path


def glasses2(folder: Path) -> Path:
    lines = ['{"ts":5,"s":0,"ac":[0.1,-9.8,0.2]}', '{"ts":6,"s":0,"pts":1,"pv":4}']
    for k, t_ns in enumerate(stamps(N).tolist()):
        x, y, z = (GAZE[k] * [-1, 1, -1]).tolist()  # x to the wearer's left, z forward
        head = f'{{"ts":{1000 + t_ns // 1000},"s":{int(LOST[k])},"gidx":{k}'
        direction = "0.0,0.0,0.0" if LOST[k] else f"{x!r},{y!r},{z!r}"
        for eye in ("left", "right"):
            lines.append(f'{head},"pd":{0 if LOST[k] else 3.1},"eye":"{eye}"}}')
            lines.append(f'{head},"gd":[{direction}],"eye":"{eye}"}}')
        lines.append(f'{head},"l":1,"gp":[0.5,0.5]}}')
    return text_file(folder / "livedata.json", lines)


def tobii_studio(folder: Path, version: int = 3) -> Path:
    points = {
        3: ["GazePointLeftX (ADCSpx)", "GazePointLeftY (ADCSpx)"],
        2: ["GazePointXLeft", "GazePointYLeft"],
    }[version]
    points += [name.replace("Left", "Right") for name in points]
    time = {3: "RecordingTimestamp", 2: "Timestamp"}[version]
    names = [time, "DateTimeStamp", *points, "PupilLeft", "PupilRight"]
    lines = ["\t".join([*names, "ValidityLeft", "ValidityRight", "MouseEvent"])]
    if version == 2:
        about = ["System Properties:", "Machine Name:\t PISA", "", "Data properties:", ""]
        lines = [*about, *lines]
    for k, t_ns in enumerate(stamps(N).tolist()):
        point = ["-1920", "-1080"] * 2 if LOST[k] else [f"{v:.4f}" for v in PIXELS[k]] * 2
        end = ["-1", "-1", "4", "4"] if LOST[k] else ["3.1", "3.2", "0", "0"]
        lines.append("\t".join([f"{t_ns / 1e6:.3f}", "17:15", *point, *end, ""]))
    return text_file(folder / "data.tsv", lines)


def eyelink(folder: Path, eyes: str = "LR", decimal: str = ".", rate_hz: int = 500) -> Path:
    sides = " ".join({"L": "LEFT", "R": "RIGHT"}[eye] for eye in eyes)
    lines = [
        "** CONVERTED FROM a.edf using edfapi 4.2.1",
        "** DATE: Tue Jan  2 03:04:05 2024",
        "** TYPE: EDF_FILE BINARY EVENT SAMPLE TAGGED",
        "** VERSION: EYELINK II 1",
        "** SOURCE: EYELINK CL",
        "** EYELINK II CL v6.14 Mar  6 2020 (EyeLink Portable Duo)",
        "** CAMERA: EyeLink USBCAM Version 1.01",
        "** SERIAL NUMBER: CLU-DAB50",
        "**",
        "",
        "MSG\t1000 DISPLAY_COORDS 0 0 1919 1079",
        f"START\t1000 \t{sides}\tSAMPLES\tEVENTS",
        "PRESCALER\t1",
        "VPRESCALER\t1",
        "PUPIL\tAREA",
        f"EVENTS\tGAZE\t{sides}\tRATE\t {rate_hz}.00\tTRACKING\tCR\tFILTER\t2",
        f"SAMPLES\tGAZE\t{sides}\tRATE\t {rate_hz}.00\tTRACKING\tCR\tFILTER\t2",
    ]
    step = 1000 // rate_hz
    for k in range(N):
        t = 1000 + step * k
        if k and LOST[k] and not LOST[k - 1]:
            lines += [f"SBLINK {eye} {t}" for eye in eyes]
        point = (
            "   .\t   .\t    0.0" if LOST[k] else f"{PIXELS[k][0]:.2f}\t{PIXELS[k][1]:.2f}\t900.0"
        )
        cells = (
            "\t".join([point] * len(eyes)).replace(".", decimal)
            if not LOST[k]
            else "\t".join([point] * len(eyes))
        )
        lines.append(f"{t}\t{cells}\t....." if len(eyes) == 2 else f"{t}\t{cells}\t...")
        if k > 4 and LOST[k] and (k + 1 < N and not LOST[k + 1]):
            lines += [f"EBLINK {eye} {t - 3 * step}\t{t}\t{4 * step}" for eye in eyes]
        if k == 100:
            lines.append(f"MSG\t{t} picture 1.jpg 2,5")
    lines.append(f"END\t{1000 + step * N} \tSAMPLES\tEVENTS\tRES\t  35.00\t  35.00")
    return text_file(folder / "a.asc", lines)


WRITERS: dict[Format, tuple[Writer, float]] = {
    "tobii": (tobii, 120),
    "neon": (neon, 120),
    "gazepoint": (gazepoint, 120),
    "varjo": (varjo, 120),
    "gazebase": (gazebase, 1000),
    "smi": (smi, 120),
    "glasses2": (glasses2, 120),
    "glasses3": (glasses3, 120),
    "eyelink": (eyelink, 500),
}


def away_deg(direction: Vector, valid: npt.NDArray[np.bool_]) -> float:
    assert valid.sum() == (~LOST).sum()
    return float(angle_deg(direction[valid], GAZE[~LOST]).max())


@pytest.mark.parametrize("name", sorted(WRITERS))
def test_the_same_gaze_is_read_from_every_tracker(name: Format, tmp_path: Path) -> None:
    write, rate_hz = WRITERS[name]
    recording = read_gaze(write(tmp_path), name, screen=SCREEN)
    gaze = prepare(recording)
    assert (N, pytest.approx(rate_hz, rel=0.01)) == (len(recording), gaze.rate_hz)
    for eye in recording.eyes.values():
        is_there = eye.valid & np.isfinite(eye.direction[:, 0])
        assert away_deg(eye.direction, is_there) < 0.01
    assert pytest.approx(LOST.mean(), abs=0.01) == 1 - gaze.usable["combined"].mean()


@pytest.mark.parametrize("version", [2, 3])
def test_tobii_studio_is_read_as_tobii(version: int, tmp_path: Path) -> None:
    recording = read_gaze(tobii_studio(tmp_path, version), "tobii", screen=SCREEN)
    assert ["left", "right"] == list(recording.eyes)
    for eye in recording.eyes.values():
        assert away_deg(eye.direction, eye.valid) < 0.01
        assert np.isnan(eye.pupil_mm[LOST]).all()


def test_pauses_of_eyelink_are_no_loss(tmp_path: Path) -> None:
    lines = eyelink(tmp_path).read_text(encoding="utf-8").splitlines()
    end = next(k for k, line in enumerate(lines) if line.startswith("END"))
    start = next(k for k, line in enumerate(lines) if line.startswith("START"))
    later = [
        re.sub(
            r"^(|START\t|END\t|[ES]BLINK [LR] )(\d{4})",
            lambda m: m[1] + str(int(m[2]) + 8000),
            line,
        )
        for line in lines[start : end + 1]
    ]
    path = text_file(tmp_path / "two.asc", [*lines, *later])
    once = quality_table(prepare(read_gaze(tmp_path / "a.asc", "eyelink", screen=SCREEN))).iloc[-1]
    gaze = prepare(read_gaze(path, "eyelink", screen=SCREEN))
    twice = quality_table(gaze).iloc[-1]
    assert 2 * N == len(gaze.t_ns)
    assert pytest.approx(once["lost_01"], abs=0.002) == twice["lost_01"]
    assert pytest.approx(500, rel=0.001) == twice["rate_hz"]
    assert "the recorder was paused 1 times; pauses are no loss" in gaze.remarks


def test_events_of_smi_alone_are_named(tmp_path: Path) -> None:
    path = text_file(
        tmp_path / "events.txt", ["[BeGaze]", "Converted from:\tx.idf", "Event Type\tTrial"]
    )
    with pytest.raises(DataError, match="events alone are no gaze"):
        read_gaze(path, "smi", screen=SCREEN)


def test_every_named_format_has_a_test() -> None:
    assert set(FORMATS) == {*WRITERS, "vive", "bids", "pupil", "csv"}


@settings(max_examples=12, deadline=None)
@given(
    eyes=st.sampled_from(["L", "R", "LR"]),
    decimal=st.sampled_from([".", ","]),
    rate_hz=st.sampled_from([250, 500, 1000]),
)
def test_eyelink_of_one_eye_or_both_in_every_locale(
    eyes: str, decimal: str, rate_hz: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = eyelink(tmp_path_factory.mktemp("e"), eyes, decimal, rate_hz)
    recording = read_gaze(path, "eyelink", screen=SCREEN)
    assert {"L": {"left"}, "R": {"right"}, "LR": {"left", "right"}}[eyes] == set(recording.eyes)
    for eye in recording.eyes.values():
        assert away_deg(eye.direction, np.isfinite(eye.direction[:, 0])) < 0.01
    assert rate_hz == recording.rate_hz


@pytest.mark.filterwarnings("ignore:The inplace keyword")  # of pandas, about a call in mne
def test_mne_reads_the_same_from_an_eyelink_file(tmp_path: Path) -> None:
    path = eyelink(tmp_path)
    raw = mne.io.read_raw_eyelink(path, verbose="error")
    theirs = raw.get_data(picks=["xpos_left", "ypos_left"])
    recording = read_gaze(path, "eyelink", screen=SCREEN)
    assert recording.left is not None
    expected = SCREEN.directions_of(theirs.T)
    there = np.isfinite(expected[:, 0])
    assert there.sum() == (~LOST).sum()
    assert np.allclose(expected[there], recording.left.direction[there])
    assert raw.info["sfreq"] == recording.rate_hz


@pytest.mark.parametrize(("decimal", "microseconds"), [(",", True), (".", False)])
def test_tobii_of_other_locales_and_versions(
    decimal: str, microseconds: bool, tmp_path: Path
) -> None:
    recording = read_gaze(tobii(tmp_path, decimal, microseconds), "tobii", screen=SCREEN)
    assert pytest.approx(120, rel=0.01) == prepare(recording).rate_hz
    assert recording.left is not None
    assert away_deg(recording.left.direction, recording.left.valid) < 0.01


@pytest.mark.parametrize("name", ["tobii", "gazepoint", "eyelink"])
def test_gaze_on_a_screen_needs_the_screen(name: Format, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--screen"):
        read_gaze(WRITERS[name][0](tmp_path), name)


def test_another_screen_than_eyelinks_is_refused(tmp_path: Path) -> None:
    other = FlatScreen(0.53, 0.30, 1280, 1024, 0.65)
    with pytest.raises(DataError, match="1920 by 1080 pixels, --screen says 1280 by 1024"):
        read_gaze(eyelink(tmp_path), "eyelink", screen=other)


def test_a_last_line_that_is_cut_is_left_out(tmp_path: Path) -> None:
    path = glasses3(tmp_path)
    plain = tmp_path / "gazedata"
    plain.write_bytes(gzip.decompress(path.read_bytes())[:-40])
    recording = read_gaze(plain, "glasses3")
    assert N - 1 == len(recording)
    assert "the last, is cut off" in recording.remarks[0]
    asc = eyelink(tmp_path)
    lines = asc.read_text().splitlines()[:-1]
    asc.write_text("\n".join([*lines, "1480\t900.1\t5"]))
    cut = read_gaze(asc, "eyelink", screen=SCREEN)
    assert (N, True) == (len(cut), "the last, has no end" in cut.remarks[0])


def test_a_file_of_another_program_is_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="not of neon"):
        read_gaze(varjo(tmp_path), "neon")


def test_a_sample_of_eyelink_that_is_cut_within_its_last_number_is_left_out(tmp_path: Path) -> None:
    whole = eyelink(tmp_path)
    text = whole.read_text(encoding="utf-8").rstrip("\n")
    lines = text.splitlines()
    last = max(k for k, line in enumerate(lines) if line[:1].isdigit())
    cut = tmp_path / "cut.asc"
    cut.write_text("\n".join(lines[: last + 1])[:-1], encoding="utf-8")
    recording = read_gaze(cut, "eyelink", None, SCREEN)
    assert len(read_gaze(whole, "eyelink", None, SCREEN)) - 1 == len(recording)
    assert "has no end: it was left out" in recording.remarks[0]
