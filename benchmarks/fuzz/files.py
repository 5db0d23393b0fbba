"""What reads files: one target per reader, with a whole file of its format as sample."""

import gzip
import io
import json
import shutil
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from PIL import Image, PngImagePlugin

from benchmarks.fuzz.codecs import WIRES
from benchmarks.fuzz.damage import (
    arrays_again,
    chained_again,
    damaged,
    journal_again,
    json_or_bytes,
    sealed_again,
)
from benchmarks.fuzz.target import Target
from tests.analysis.gaze.test_import import PUPIL, vive_text
from tests.recording.sessions import record_session
from tests.recording.test_export import gaze_session
from tests.stimuli.glb_figure import write_glb
from tests.stimuli.motion.motions import SMALL_BVH
from tests.stimuli.motion.speaking.test_annotations import ANVIL, ELAN
from visavis.analysis.foreign_check import read_bids_times, read_xdf_times
from visavis.analysis.foreign_motion import motion_table, quality_of_motion, read_bids_motion
from visavis.analysis.gaze.bids import read_bids
from visavis.analysis.gaze.mapped_csv import mapping_of, read_csv, read_mapping
from visavis.analysis.gaze.readers import read_pupil, read_vive
from visavis.analysis.session_check import check_session
from visavis.analysis.statistics_report.table_file import read_table
from visavis.devices.wirelog import read_wire_log
from visavis.lab.clock import SimClock
from visavis.lab.config import parse_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import LabError
from visavis.lab.plain_files import parse_json
from visavis.lab.yaml_lines import parse_document
from visavis.protocol.people.exports_register import register_export, registered_exports
from visavis.protocol.people.key_file import KeyFile
from visavis.protocol.people.ledger import Ledger
from visavis.protocol.people.own_body import OWN_BODY_NAME, OwnBody, read_own_body, write_own_body
from visavis.protocol.plan.questionnaires import SCALES_DIR, load_questionnaire
from visavis.recording.bids import export_bids
from visavis.recording.chained import append_lines, read_lines
from visavis.recording.journal import decode_line
from visavis.recording.journal_file import read_journal
from visavis.recording.manifest import read_with_seal
from visavis.recording.reader import Recording
from visavis.recording.sealed import read_sealed, seal
from visavis.recording.stream_file import read_stream_file
from visavis.recording.xdf import export_xdf
from visavis.results.opened_study import find_study
from visavis.results.picture_delay import SETTING, read_sync_test
from visavis.running.page.other_hosts.results import read_runs
from visavis.running.sessions.piecewise import read_stored_trial
from visavis.running.sessions.plan_lock import (
    LOCK_NAME,
    PEEKS_NAME,
    lock_plan,
    read_lock,
    read_peeks,
)
from visavis.running.sessions.study_folder import StudySettings, read_settings, settle
from visavis.stimuli.area_files import _read as read_areas
from visavis.stimuli.characters.gltf import import_gltf
from visavis.stimuli.characters.gltf.figure import read_figure
from visavis.stimuli.characters.gltf.file import read_glb
from visavis.stimuli.characters.storage import read_character, write_character
from visavis.stimuli.film_file import FilmFacts
from visavis.stimuli.flat_pixels import read_picture
from visavis.stimuli.motion.bvh import parse_bvh
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.clip_file import read_clip, write_clip
from visavis.stimuli.motion.skeleton import canonical_skeleton
from visavis.stimuli.motion.speaking.annotations import read_any_script
from visavis.study.texts import WORDS_DIR, read_texts

TOLD_BY_IMPORT = (
    LookupError,
    TypeError,
    ValueError,
    ArithmeticError,
    AttributeError,
    RecursionError,
    MemoryError,
)
"""What `import_gltf` tells as a broken file, whatever step of it raised it."""
IMPORTS_SHARE_01 = 0.01
"""An import measures, thins and wraps a person: a tenth of a second where a reader takes a
thousandth of that."""
MAPPING = """time: {column: t, unit: s}
space: head
combined: {direction: [x, y, z]}
"""
CSV = "t,x,y,z\n0,0,0,-1\n0.01,0.1,0,-1\n0.02,0.2,0,-1\n"
RUN = (
    {"run": "a1", "line": 0, "at_ms": 1.7e12, "arrived": {
        "format": 1, "study": "stare", "seed": 1, "place": 0, "sha256": "00",
        "parameters": {"PROLIFIC_PID": "5f0c", "STUDY_ID": "x"}}},
    {"run": "a1", "line": 1, "at_ms": 1.7e12 + 40, "opened": {"tab": "t", "at_ms": 12.5}},
)  # fmt: skip
"""What one person's page hands over, line by line."""
SYNC = {"offsets_ms": {SETTING: 12.5}, "made": "2026-01-01T00:00:00+00:00", "is_simulated": False}
TABLE = "participant,condition,dwell_ms\n1,A,100.5\n1,B,120\n2,A,90\n2,B,140\n"


def files(scratch: Path) -> Iterator[Target]:
    """Yield a target per reader; `scratch` holds the file that is read, one at a time."""
    made = scratch / "made"
    session = record_session(made, 1, rows=30)
    gaze = gaze_session(made / "gaze")
    xdf = export_xdf(Recording(session), made / "xdf")[0]
    export_bids([gaze], made / "bids", task="fuzz", dataset_name="fuzz")
    physio = next((made / "bids").rglob("*eye1_physio.tsv.gz"))
    study = made / "study"
    study.mkdir()
    ledger = Ledger(study, SimClock())
    for _ in range(3):
        ledger.add()
    settings = StudySettings("stare", 1, False, parameters={"trial_s": 4.0})
    settle(study, settings, seed_given=True)
    register_export(study, SimClock(), "bids", made / "bids", ["01B"], [physio])
    KeyFile(made / "keys", "stare", []).identify("01B", {"name": "Ann"})
    part = session / "part-01"
    journal = (part / "events.jsonl").read_bytes()
    skeleton = canonical_skeleton()
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (4, len(skeleton.names), 1))
    write_clip(made / "clip.npz", Clip(skeleton, 0.01, np.zeros((4, 3)), turns))
    write_glb(made / "figure.glb")
    person = import_gltf(made / "figure.glb", gender="male")
    person = replace(person, levels=person.levels[-1:], closed=None, measuring=())
    write_character(person, made / "person.npz")
    told = study / "sub-01B"
    write_own_body(told, OwnBody("female", 1.7))
    planned = find_study("stare")
    lock_plan(study, planned, planned.experiment({}), 1, SimClock(), participants=3)
    append_lines(study / PEEKS_NAME, [{"at": "2026-01-01", "sessions": 1, "reason": "asked"}])

    def at(name: str, read: Callable[[Path], object]) -> Callable[[bytes], object]:
        path = scratch / "read" / name
        path.parent.mkdir(parents=True, exist_ok=True)

        def written(data: bytes) -> object:
            path.write_bytes(data)
            return read(path)

        return written

    def target(name: str, sample: bytes | str, read: Callable[[bytes], object]) -> Target:
        data = sample.encode() if isinstance(sample, str) else sample
        return Target(name, (data,), read, (LabError,))

    def of_file(name: str, file: Path, read: Callable[[Path], object]) -> Target:
        return target(name, file.read_bytes(), at(file.name, read))

    def again(found: Target, change: Callable[[bytes, bytes, Iterator[int]], bytes]) -> Target:
        return replace(found, name=f"{found.name} sealed again", change=change)

    def of_session(file: Path) -> Target:
        """Return what opens and checks a whole session of which one file is written each time."""
        whole = scratch / "read" / f"of-{file.name}"
        shutil.copytree(session, whole)

        def checked(data: bytes) -> object:
            (whole / file).write_bytes(data)
            return check_session(Recording(whole))

        return target(
            f"visavis.analysis.session_check {file.name}", (session / file).read_bytes(), checked
        )

    yield Target("visavis.recording.journal line", tuple(journal.splitlines()), decode_line)
    lines = of_file("visavis.recording.journal_file", part / "events.jsonl", read_journal)
    yield from (lines, again(lines, journal_again))
    yield of_file("visavis.recording.stream_file", part / "probe.arrows", read_stream_file)
    manifest = of_file(
        "visavis.recording.manifest", session / "manifest.json", lambda p: read_with_seal(p.parent)
    )
    yield from (manifest, again(manifest, sealed_again))
    yield again(of_session(Path("manifest.json")), sealed_again)
    yield again(of_session(Path(part.name, "events.jsonl")), journal_again)
    yield of_session(Path(part.name, "probe.arrows"))
    yield target(
        "visavis.recording.sealed", (study / "study.json").read_bytes(), at("x.json", _sealed)
    )
    yield target(
        "visavis.recording.chained",
        (study / "participants.jsonl").read_bytes(),
        at("lines.jsonl", read_lines),
    )
    people = target(
        "visavis.protocol.people.ledger",
        (study / "participants.jsonl").read_bytes(),
        at(f"{study.name}/participants.jsonl", lambda p: Ledger(p.parent, SimClock()).list()),
    )
    yield from (people, again(people, chained_again))
    exports = of_file(
        "visavis.protocol.people.exports_register",
        study / "exports.jsonl",
        lambda p: registered_exports(p.parent),
    )
    yield from (exports, again(exports, chained_again))
    own = target(
        "visavis.protocol.people.own_body",
        (told / OWN_BODY_NAME).read_bytes(),
        at(f"{told.name}/{OWN_BODY_NAME}", lambda p: read_own_body(p.parent)),
    )
    yield from (own, again(own, sealed_again))
    lock = of_file("visavis.plan_lock", study / LOCK_NAME, lambda p: read_lock(p.parent))
    yield from (lock, again(lock, sealed_again))
    peeks = of_file("visavis.plan_lock peeks", study / PEEKS_NAME, lambda p: read_peeks(p.parent))
    yield from (peeks, again(peeks, chained_again))
    kept = seal({"row": {"dwell_ms": 1.5}, "tables": {"looks": [{"zone": "A"}, {"zone": "B"}]}})
    measured = target("visavis.piecewise", kept, at("kept.json", read_stored_trial))
    yield from (measured, again(measured, sealed_again))
    yield target("visavis.results.picture_delay", json.dumps(SYNC), at("sync.json", read_sync_test))
    told_lines = "".join(json.dumps(line) + "\n" for line in RUN)
    yield target("visavis.elsewhere results", told_lines, at("results.jsonl", _runs))
    yield target("visavis.elsewhere archive", zipped(told_lines), at("results.zip", _runs))
    yield of_file(
        "visavis.protocol.plan.questionnaires", SCALES_DIR / "free_comment.yaml", load_questionnaire
    )
    yield target(
        "visavis.study.texts",
        "\n".join((WORDS_DIR / "en.yaml").read_text("utf-8").splitlines()[:6]),
        at("texts/en.yaml", lambda p: read_texts([p.parent])),
    )
    keys = target(
        "visavis.protocol.people.key_file",
        (made / "keys" / "stare.json").read_bytes(),
        at("keys/stare.json", _key_of),
    )
    yield from (keys, again(keys, sealed_again))
    begun = of_file("visavis.study_folder", study / "study.json", lambda p: read_settings(p.parent))
    yield from (begun, again(begun, sealed_again))
    yield target("visavis.lab.plain_files parse_json", json_sample(session), parse_json_of)
    yield target("visavis.lab.yaml_lines", config_sample(), _yaml)
    yield target("visavis.lab.config", config_sample(), _config)
    yield of_file("visavis.devices.wirelog", WIRES / "neosensory_buzz.wire", read_wire_log)
    yield of_file("visavis.analysis.foreign_check xdf", xdf, read_xdf_times)
    yield target("visavis.analysis.gaze.readers vive", vive_text(n=20), at("v.csv", read_vive))
    yield target("visavis.analysis.gaze.readers pupil", PUPIL, at("gaze_positions.csv", read_pupil))
    mapping = mapping_of(
        {
            "time": {"column": "t", "unit": "s"},
            "space": "head",
            "combined": {"direction": ["x", "y", "z"]},
        }
    )
    yield target(
        "visavis.analysis.gaze.mapped_csv", CSV, at("m.csv", lambda p: read_csv(p, mapping))
    )
    yield target("visavis.analysis.gaze.mapped_csv mapping", MAPPING, at("map.yaml", read_mapping))
    bids = scratch / "read"
    bids.mkdir(exist_ok=True)
    beside = bids / "sub-1_recording-eye1_physio.json"
    beside.write_bytes(physio.with_suffix("").with_suffix(".json").read_bytes())
    packed = at("sub-1_recording-eye1_physio.tsv.gz", read_bids)
    yield target("visavis.analysis.gaze.bids packed", physio.read_bytes(), packed)
    yield target(
        "visavis.analysis.gaze.bids rows",
        gzip.decompress(physio.read_bytes()),
        lambda data: packed(gzip.compress(data, 1)),
    )
    yield from foreign_bids(scratch / "foreign")
    yield target("visavis.analysis.statistics_report table", TABLE, at("t.csv", read_table))
    packed_table = io.BytesIO()
    pd.read_csv(io.StringIO(TABLE)).to_parquet(packed_table, index=False)
    yield target(
        "visavis.analysis.statistics_report parquet",
        packed_table.getvalue(),
        at("t.parquet", read_table),
    )
    yield target(
        "visavis.stimuli.motion.bvh", SMALL_BVH, lambda data: parse_bvh(data.decode("latin-1"))
    )
    for ending, picture in pictures().items():
        yield target(
            f"visavis.stimuli.flat_pixels {ending}", picture, at(f"picture.{ending}", read_picture)
        )
    for ending, areas in AREAS.items():
        yield target(f"visavis.stimuli.area_files {ending}", areas, at(f"areas.{ending}", _areas))
    for ending, script in (("anvil", ANVIL), ("eaf", ELAN.read_text("utf-8"))):
        name = f"visavis.stimuli.motion.speaking {ending}"
        yield target(name, script, at(f"take.{ending}", read_any_script))
    clip = of_file("visavis.stimuli.motion.clip_file", made / "clip.npz", read_clip)
    yield from (clip, again(clip, arrays_again))
    figure = made / "figure.glb"
    yield replace(
        of_file("visavis.stimuli.characters glb read", figure, lambda p: read_figure(read_glb(p))),
        refusals=(LabError, *TOLD_BY_IMPORT),
    )
    imported = of_file(
        "visavis.stimuli.characters glb", figure, lambda p: import_gltf(p, gender="male")
    )
    yield replace(imported, share_01=IMPORTS_SHARE_01)
    character = of_file("visavis.stimuli.characters npz", made / "person.npz", read_character)
    yield from (character, again(character, arrays_again))


def foreign_bids(root: Path) -> Iterator[Target]:
    """Yield targets per file of a data set of other software, as `check` and `import` read it."""
    motion, gaze = root / "sub-1_tracksys-a_motion.tsv", root / "sub-1_recording-eye1_physio.tsv"
    root.mkdir(parents=True)
    (root / "dataset_description.json").write_text("{}")
    content = {
        motion: "0.0\t1.5\t1\t2\t0.1\t0\t90\n0.1\t1.6\t1\t2\t0.1\t0\t91\n0.2" + "\tn/a" * 6,
        motion.with_suffix(".json"): '{"SamplingFrequency": 10}',
        motion.with_name("sub-1_tracksys-a_channels.tsv"): CHANNELS_OF_MOTION,
        motion.with_name("sub-1_tracksys-a_channels.json"): FRAME_OF_MOTION,
        gaze: "0.0\t1\n0.1\t2\n",
        gaze.with_suffix(".json"): '{"SamplingFrequency": 10, "Columns": ["timestamp", "x"]}',
    }

    def written(path: Path, data: bytes) -> None:
        if path == gaze:
            path.with_name(f"{path.name}.gz").write_bytes(gzip.compress(data, 1))
        else:
            path.write_bytes(data)

    def imported(root: Path) -> object:
        body_motion = read_bids_motion(root / motion.name)
        return quality_of_motion(body_motion), motion_table(body_motion)

    def target(reader: Callable[[Path], object], name: str, path: Path, whole: bytes) -> Target:
        def read(data: bytes) -> object:
            written(path, data)
            try:
                return reader(root)
            finally:
                written(path, whole)

        name = f"visavis.analysis.{name} {path.name.split('_', 1)[1]}"
        change = json_or_bytes if path.suffix == ".json" else damaged
        return Target(name, (whole,), read, (LabError,), change=change)

    for path, text in content.items():
        written(path, text.encode())
    for path, text in content.items():
        yield target(read_bids_times, "foreign_check", path, text.encode())
        if "tracksys" in path.name:
            yield target(imported, "foreign_motion", path, text.encode())


CHANNELS_OF_MOTION = (
    "name\tcomponent\ttype\ttracked_point\tunits\treference_frame\n"
    "latency\tn/a\tLATENCY\tn/a\ts\tn/a\n"
    + "".join(f"p{axis}\t{axis}\tPOS\thead\tm\tglobal\n" for axis in "xyz")
    + "".join(f"r{axis}\t{axis}\tORNT\thead\tdeg\tglobal\n" for axis in "xyz")
)
FRAME_OF_MOTION = (
    '{"reference_frame": {"Levels": {"global": {"SpatialAxes": "ALS", "RotationRule": '
    '"right-hand", "RotationOrder": "ZXY"}}}}'
)


def pictures() -> dict[str, bytes]:
    """Return a small picture in each format, with what cameras and programs write beside it."""
    shades, exif = np.arange(144, dtype=np.uint8).reshape(6, 8, 3), Image.Exif()
    exif[0x0112], exif[0x010F] = 6, "camera"
    exif.get_ifd(0x8825)[18] = "WGS-84"
    text = PngImagePlugin.PngInfo()
    text.add_text("Author", "somebody", zip=True)
    text.add_itxt("XML:com.adobe.xmp", '<x tiff:Orientation="6"/>')
    pictures = {}
    beside: dict[str, dict[str, Any]] = {
        "png": {"exif": exif, "pnginfo": text, "icc_profile": b"profile" * 9},
        "jpg": {"exif": exif, "icc_profile": b"profile" * 9, "comment": b"words"},
        "webp": {"exif": exif, "lossless": True},
        "tiff": {"tiffinfo": {270: "words", 0x0112: 6}},
        "gif": {"comment": b"words"},
    }
    for ending, more in beside.items():
        written = io.BytesIO()
        Image.fromarray(shades).save(written, {"jpg": "JPEG"}.get(ending, ending), **more)
        pictures[ending] = written.getvalue()
    return pictures


AREAS = {
    "svg": '<svg viewBox="0 0 8 6"><g><rect id="a" x="1" y="1" width="2" height="2"/></g>'
    '<path id="b" d="M4 1h3v2L4 3z" data-salience="2"/><circle id="c" cx="3" cy="4" r="1"/></svg>',
    "csv": "area,t_s,x,y,salience\na,,1,1,2\na,,3,1,\na,,3,3,\n"
    "b,0,4,1,\nb,0,6,1,\nb,0,6,3,\nb,1,,,\n",
    "yaml": "a: {polygon: [[1, 1], [3, 1], [3, 3]]}\nb: {ellipse: [5, 3, 2, 2], turn_deg: 10}\n"
    "c: {keys: [{t_s: 0, rectangle: [1, 1, 2, 2]}, {frame: 9, gone: true}]}\n",
}
"""Areas of a film of 8 by 6 pixels."""
FILM = FilmFacts((8, 6), np.arange(10) / 10, 1.0, False, 0.0)


def _areas(path: Path) -> object:
    return read_areas.__wrapped__(path, 0, (8, 6), is_around=False, film=FILM)


def zipped(text: str) -> bytes:
    """Return an archive of one file of results."""
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("study_result_1/comp-result_1/data.txt", text)
    return written.getvalue()


def _runs(path: Path) -> object:
    runs, _ = read_runs([path])
    return [(run.begun_ms, run.arrival, run.place) for run in runs]


def config_sample() -> str:
    """Return a lab's configuration without comments and with few devices: less text to parse."""
    lines = EXAMPLE.read_text("utf-8").splitlines()
    said = [line for line in lines if line.strip() and not line.strip().startswith("#")]
    return "\n".join(said[: said.index("  body_tracker:")]) + "\n"


def json_sample(session: Path) -> bytes:
    """Return a JSON text of some depth."""
    return (session / "manifest.json").read_bytes()


def parse_json_of(data: bytes) -> object:
    """Parse JSON; what is none is a ValueError by contract, which is not a refusal of ours."""
    try:
        return parse_json(data)
    except ValueError:
        return None


def _sealed(path: Path) -> object:
    try:
        return read_sealed(path)
    except ValueError:  # its contract
        return None


def _key_of(path: Path) -> object:
    path.chmod(0o600)
    path.parent.chmod(0o700)
    return KeyFile(path.parent, "stare", []).identity("01B")


def _yaml(data: bytes) -> object:
    return parse_document(data.decode("utf-8", "replace"), Path("lab_config.yaml"))


def _config(data: bytes) -> object:
    return parse_config(data.decode("utf-8", "replace"), Path("lab_config.yaml"))
