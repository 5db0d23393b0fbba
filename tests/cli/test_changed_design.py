"""A folder holds sessions of one design: what changed since is named, and does not mix."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image as Picture
from typer.testing import CliRunner

from tests.faults.sessions import CONFIG
from visavis.cli.main import app
from visavis.cli.studies import StudyHere
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import UsageError
from visavis.recording.manifest import read_manifest
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.recorded_design import (
    changes_since,
    compare_designs,
    design_of,
    design_of_session,
    in_words,
)
from visavis.running.sessions.session_request import simulated_request
from visavis.running.sessions.study_folder import read_settings
from visavis.study.files_read import differing_files

STUDY = """
from visavis import Compare, Factor, Rating, Scene, Study

study = Study(
    "meet",
    factors=[Factor("motion", ["idle", "wave"])],
    repetitions=1,
    parameters={"person_s": 0.2},
    calibrate=False,
    uses=[],
    compare=[Compare("nice", within="motion", claim="who waves is nice", expects="wave > idle")],
)


@study.trial
def trial(t):
    yield t.show(Scene("person", motion=t.motion, distance_m=1.5), seconds=t.person_s)
    yield t.ask(Rating("nice", 1, 7))
"""
STUDY_OF_A_PICTURE = STUDY.replace(
    'Scene("person", motion=t.motion, distance_m=1.5)', 'Image("a.png", 5)'
).replace("import Compare", "import Image, Compare")
CHANGES = [
    ('["idle", "wave"]', '["idle", "wave", "talk"]',
     "factor motion: levels idle, wave, now idle, wave, talk"),
    ("repetitions=1", "repetitions=2", "parameter repetitions 1, now 2"),
    ('"person_s": 0.2', '"person_s": 0.3', "parameter person_s 0.2, now 0.3"),
    ('"nice", 1, 7', '"nice", 1, 5',
     "question nice: options 1, 2, 3, 4, 5, 6, 7, now 1, 2, 3, 4, 5"),
    ("distance_m=1.5", "distance_m=2.5", "scene person: distance_m 1.5, now 2.5"),
    ("    yield t.show", "    yield t.dark(0.5)\n    yield t.show",
     "trials seconds 2.7, now 3.2"),
]  # fmt: skip


def visavis(*arguments: str) -> str:
    result = CliRunner().invoke(app, [*arguments, "--config", str(CONFIG)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return " ".join(result.output.split())


def simulated(file: Path, root: Path, participants: int) -> str:
    people = ("--participants", str(participants), "--processes", "1")
    return visavis("simulate", str(file), *people, "--output", str(root))


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a study's file, and one session of it in `out`."""
    root = tmp_path_factory.mktemp("begun")
    (root / "meet.py").write_text(STUDY, "utf-8")
    simulated(root / "meet.py", root / "out", 1)
    return root


@pytest.fixture
def file(begun: Path) -> Path:
    (begun / "meet.py").write_text(STUDY, "utf-8")
    return begun / "meet.py"


@pytest.mark.parametrize(("right", "other", "said"), CHANGES, ids=[c[1].strip() for c in CHANGES])
def test_a_study_of_another_design_is_not_simulated_into_a_folder(
    file: Path, right: str, other: str, said: str
) -> None:
    assert right in STUDY
    file.write_text(STUDY.replace(right, other), "utf-8")

    with pytest.raises(UsageError) as refused:
        simulated(file, file.parent / "out", 2)

    assert said in str(refused.value)
    assert "another --output" in str(refused.value)
    assert 1 == len(list((file.parent / "out/simulated/meet").glob("sub-*/ses-*")))


def test_a_session_of_another_design_is_not_run(file: Path, tmp_path: Path) -> None:
    config = tmp_path / "lab_config.yaml"
    config.write_text(CONFIG.read_text("utf-8"), "utf-8")
    shutil.copytree(file.parent / "out", tmp_path / "data")
    file.write_text(STUDY.replace('"wave"]', '"wave", "talk"]'), "utf-8")
    run = ("run", str(file), "--participant", "2", "--devices", "sim", "--fast")
    result = CliRunner().invoke(app, [*run, "--config", str(config)])

    assert isinstance(result.exception, UsageError)
    said = str(result.exception)
    assert "levels idle, wave, now idle, wave, talk" in said
    assert "--output" not in said
    assert "data_root in lab_config.yaml" in said
    plan = CliRunner().invoke(app, ["plan", str(file), "--config", str(config)]).output
    assert "had another design" in " ".join(plan.split())


def test_what_is_read_or_analysed_may_change_and_is_told(file: Path, tmp_path: Path) -> None:
    shutil.copytree(file.parent / "out", tmp_path / "out")
    file.write_text(STUDY.replace("is nice", "seems nice"), "utf-8")

    assert "has changed since" in simulated(file, tmp_path / "out", 2)
    sessions = list((tmp_path / "out/simulated/meet").glob("sub-*/ses-*"))
    assert 2 == len(sessions)


def test_analysis_names_what_changed_and_states_what_sessions_had(
    file: Path, tmp_path: Path
) -> None:
    shutil.copytree(file.parent / "out", tmp_path / "out")
    folder = tmp_path / "out/simulated/meet"
    file.write_text(STUDY.replace('"wave"]', '"wave", "talk"]'), "utf-8")

    said = visavis("analyse", str(folder), "--processes", "1")
    methods = (folder / "derived/report.html").read_text("utf-8")

    assert "factor motion: levels idle, wave, now idle, wave, talk" in said
    assert "motion (idle, wave; within participants)" in methods
    assert "once: 2 trials" in methods


def test_sessions_of_two_designs_in_a_folder_are_told_apart(file: Path, tmp_path: Path) -> None:
    manifest = read_manifest(next((file.parent / "out").rglob("ses-001")))
    file.write_text(STUDY.replace("repetitions=1", "repetitions=3"), "utf-8")
    experiment = find_study(str(file)).experiment({})
    later = manifest.__class__(
        **{
            **vars(manifest),
            "participant": "S02C",
            "configuration": {"design": design_of(experiment)},
        }
    )

    changes, mixed = compare_designs([manifest, later], experiment)

    assert "parameter repetitions 1, now 3" == in_words(changes)
    assert "1 of 2 sessions" in mixed
    assert "S02C: parameter repetitions 1, now 3" in mixed


def test_a_picture_that_was_not_the_same_in_all_sessions_is_named(tmp_path: Path) -> None:
    (tmp_path / "meet.py").write_text(STUDY_OF_A_PICTURE, "utf-8")
    outputs = []
    for participants, colour in ((1, "red"), (2, "red"), (3, "blue")):
        Picture.new("RGB", (40, 40), colour).save(tmp_path / "a.png")
        outputs.append(simulated(tmp_path / "meet.py", tmp_path / "out", participants))
    note = "other files than in the first session of"
    assert [False, False, True] == [note in output for output in outputs]
    folder = tmp_path / "out" / "simulated" / "meet"
    says = "a.png was not the same file in all sessions"
    assert says in visavis("analyse", str(folder))
    configurations = [read_manifest(p.parent).configuration for p in folder.rglob("manifest.json")]
    assert ["a.png"] == differing_files(configurations)
    assert [] == differing_files(configurations[:1] * 2)
    lab = load_config(EXAMPLE).model_copy(update={"data_root": tmp_path / "out"})
    here = StudyHere(lab, find_study(str(tmp_path / "meet.py")))
    settings = read_settings(folder)
    assert settings is not None
    assert note in here.require_same_design(settings, settings)


def test_a_session_that_goes_on_says_which_picture_is_another_one_now(tmp_path: Path) -> None:
    file = tmp_path / "meet.py"
    file.write_text(STUDY_OF_A_PICTURE, "utf-8")
    Picture.new("RGB", (40, 40), "red").save(tmp_path / "a.png")
    simulated(file, tmp_path / "out", 1)
    study = find_study(str(file))
    lab = load_config(EXAMPLE).model_copy(update={"data_root": tmp_path / "out"})
    request = simulated_request(study, study.experiment({}), lab, label="S01B", index=0, seed=1)
    (session,) = (tmp_path / "out").rglob("sub-S01B/ses-001")
    shutil.rmtree(session)

    def end(*_: object) -> None:
        raise InterruptedError

    with pytest.raises(InterruptedError):
        perform_new(replace(request, on_trial=end))
    Picture.new("RGB", (40, 40), "blue").save(tmp_path / "a.png")
    output = visavis("resume", str(session), "--fast")
    assert "a.png is another file now than when" in output
    assert "complete" == Recording(session).status


def test_a_criterion_of_practice_that_comes_or_goes_is_another_design(file: Path) -> None:
    text = STUDY.replace("repetitions=1", "repetitions=1, practice=2")
    until = 'practice=2, practice_until=Criterion("nice")'
    file.write_text(text, "utf-8")
    without = design_of(find_study(str(file)).experiment({}))
    file.write_text("from visavis import Criterion\n" + text.replace("practice=2", until), "utf-8")
    having = design_of(find_study(str(file)).experiment({}))

    assert "practice_until of is new" in in_words(changes_since(without, having))
    assert "practice_until of is gone" in in_words(changes_since(having, without))
    del without["practice_until"]  # as sessions of earlier versions
    assert () == changes_since(without, having)


def test_a_session_recorded_before_designs_were_kept_tells_its_parameters(file: Path) -> None:
    manifest = read_manifest(next((file.parent / "out").rglob("ses-001")))
    before = manifest.__class__(**{**vars(manifest), "configuration": {}})
    experiment = find_study(str(file)).experiment({})
    assert () == changes_since(design_of_session(before), design_of(experiment))
    file.write_text(STUDY.replace("0.2", "0.4"), "utf-8")
    longer = find_study(str(file)).experiment({})

    changes = changes_since(design_of_session(before), design_of(longer))

    assert "parameter person_s 0.2, now 0.4" == in_words(changes)
