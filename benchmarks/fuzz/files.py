"""What reads files: one target per reader, with a whole file of its format as sample."""

import gzip
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from analysis.foreign_check import read_xdf_times
from analysis.gaze.bids import read_bids
from analysis.gaze.mapped_csv import mapping_of, read_csv, read_mapping
from analysis.gaze.readers import read_pupil, read_vive
from analysis.session_check import check_session
from analysis.statistics_report.table_file import read_table
from benchmarks.fuzz.codecs import WIRES
from benchmarks.fuzz.damage import chained_again, journal_again, sealed_again
from benchmarks.fuzz.target import Target
from devices.wirelog import read_wire_log
from lab.clock import SimClock
from lab.config import parse_config
from lab.config_files import EXAMPLE
from lab.errors import LabError
from lab.plain_files import parse_json
from lab.yaml_lines import parse_document
from protocol.exports_register import register_export, registered_exports
from protocol.key_file import KeyFile
from protocol.ledger import Ledger
from recording.bids import export_bids
from recording.chained import read_lines
from recording.journal import decode_line
from recording.journal_file import read_journal
from recording.manifest import read_with_seal
from recording.reader import Recording
from recording.sealed import read_sealed
from recording.stream_file import read_stream_file
from recording.xdf import export_xdf
from stimuli.characters.gltf import import_gltf
from stimuli.characters.gltf_figure import read_figure
from stimuli.characters.gltf_file import read_glb
from stimuli.characters.storage import read_character
from stimuli.motion.bvh import parse_bvh
from stimuli.motion.clip import Clip
from stimuli.motion.clip_file import read_clip, write_clip
from stimuli.motion.skeleton import canonical_skeleton
from tests.analysis.gaze.test_import import PUPIL, vive_text
from tests.recording.sessions import record_session
from tests.recording.test_export import gaze_session
from tests.stimuli.glb_figure import write_glb
from tests.stimuli.motion.motions import SMALL_BVH
from visavis.sessions.study_folder import StudySettings, read_settings, settle

TOLD_BY_IMPORT = (
    LookupError, TypeError, ValueError, ArithmeticError, AttributeError, RecursionError,
    MemoryError,
)  # fmt: skip
"""What `import_gltf` tells as a broken file, whatever step of it raised it."""
IMPORTS_SHARE_01 = 0.01
"""An import measures, thins and wraps a person: a tenth of a second where a reader takes a
thousandth of that."""
MAPPING = """time: {column: t, unit: s}
space: head
combined: {direction: [x, y, z]}
"""
CSV = "t,x,y,z\n0,0,0,-1\n0.01,0.1,0,-1\n0.02,0.2,0,-1\n"
TABLE = "participant,condition,dwell_ms\n1,A,100.5\n1,B,120\n2,A,90\n2,B,140\n"


def files(scratch: Path) -> Iterator[Target]:
    """Yield a target per reader; `scratch` holds the file that is read, one at a time."""
    made = scratch / "made"
    session = record_session(made, 2)
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

        return target(f"analysis.session_check {file.name}", (session / file).read_bytes(), checked)

    yield Target("recording.journal line", tuple(journal.splitlines()), decode_line)
    lines = of_file("recording.journal_file", part / "events.jsonl", read_journal)
    yield from (lines, again(lines, journal_again))
    yield of_file("recording.stream_file", part / "probe.arrows", read_stream_file)
    manifest = of_file(
        "recording.manifest", session / "manifest.json", lambda p: read_with_seal(p.parent)
    )
    yield from (manifest, again(manifest, sealed_again))
    yield again(of_session(Path("manifest.json")), sealed_again)
    yield again(of_session(Path(part.name, "events.jsonl")), journal_again)
    yield of_session(Path(part.name, "probe.arrows"))
    yield target("recording.sealed", (study / "study.json").read_bytes(), at("x.json", _sealed))
    yield target(
        "recording.chained",
        (study / "participants.jsonl").read_bytes(),
        at("lines.jsonl", read_lines),
    )
    people = of_file(
        "protocol.ledger",
        study / "participants.jsonl",
        lambda p: Ledger(p.parent, SimClock()).list(),
    )
    yield from (people, again(people, chained_again))
    exports = of_file(
        "protocol.exports_register", study / "exports.jsonl", lambda p: registered_exports(p.parent)
    )
    yield from (exports, again(exports, chained_again))
    keys = target(
        "protocol.key_file",
        (made / "keys" / "stare.json").read_bytes(),
        at("keys/stare.json", _key_of),
    )
    yield from (keys, again(keys, sealed_again))
    begun = of_file("visavis.study_folder", study / "study.json", lambda p: read_settings(p.parent))
    yield from (begun, again(begun, sealed_again))
    yield target("lab.plain_files parse_json", json_sample(session), parse_json_of)
    yield target("lab.yaml_lines", config_sample(), _yaml)
    yield target("lab.config", config_sample(), _config)
    yield of_file("devices.wirelog", WIRES / "neosensory_buzz.wire", read_wire_log)
    yield of_file("analysis.foreign_check xdf", xdf, read_xdf_times)
    yield target("analysis.gaze.readers vive", vive_text(n=20), at("v.csv", read_vive))
    yield target("analysis.gaze.readers pupil", PUPIL, at("gaze_positions.csv", read_pupil))
    mapping = mapping_of({"time": {"column": "t", "unit": "s"}, "space": "head",
                          "combined": {"direction": ["x", "y", "z"]}})  # fmt: skip
    yield target("analysis.gaze.mapped_csv", CSV, at("m.csv", lambda p: read_csv(p, mapping)))
    yield target("analysis.gaze.mapped_csv mapping", MAPPING, at("map.yaml", read_mapping))
    bids = scratch / "read"
    bids.mkdir(exist_ok=True)
    beside = bids / "sub-1_recording-eye1_physio.json"
    beside.write_bytes(physio.with_suffix("").with_suffix(".json").read_bytes())
    packed = at("sub-1_recording-eye1_physio.tsv.gz", read_bids)
    yield target("analysis.gaze.bids packed", physio.read_bytes(), packed)
    yield target(
        "analysis.gaze.bids rows",
        gzip.decompress(physio.read_bytes()),
        lambda data: packed(gzip.compress(data, 1)),
    )
    yield target("analysis.statistics_report table", TABLE, at("t.csv", read_table))
    yield target("stimuli.motion.bvh", SMALL_BVH, lambda data: parse_bvh(data.decode("latin-1")))
    yield of_file("stimuli.motion.clip_file", made / "clip.npz", read_clip)
    figure = made / "figure.glb"
    yield replace(
        of_file("stimuli.characters glb read", figure, lambda p: read_figure(read_glb(p))),
        refusals=(LabError, *TOLD_BY_IMPORT),
    )
    imported = of_file("stimuli.characters glb", figure, lambda p: import_gltf(p, gender="male"))
    yield replace(imported, share_01=IMPORTS_SHARE_01)
    yield of_file("stimuli.characters npz", made / "clip.npz", read_character)


def config_sample() -> str:
    """Return a lab's configuration without comments and with few devices: less text to parse."""
    lines = EXAMPLE.read_text("utf-8").splitlines()
    said = [line for line in lines if line.strip() and not line.strip().startswith("#")]
    return "\n".join(said[: said.index("  body_tracker:")]) + "\n"


def json_sample(session: Path) -> bytes:
    """Return a JSON text of some depth."""
    return (session / "manifest.json").read_bytes().splitlines()[0]


def parse_json_of(data: bytes) -> object:
    """Parse JSON; what is none is a ValueError by contract, which is no refusal of ours."""
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
