"""A locked plan: written once, carried by sessions, what deviates is named with since when."""

import json
import re
from pathlib import Path

import pandas as pd
import pytest
from PIL import Image
from typer.testing import CliRunner

import visavis
from tests.faults.sessions import CONFIG
from visavis.cli.main import app
from visavis.lab.clock import SimClock
from visavis.lab.errors import DataError, UsageError
from visavis.results.locked_plan.deviations import deviations_between
from visavis.results.opened_study import find_study
from visavis.running.sessions.folder_check import repair_study, study_problems
from visavis.running.sessions.plan_lock import (
    LOCK_NAME,
    PAGE_NAME,
    content_now,
    lock_plan,
    read_lock,
)

SIMULATED = ("--devices", "sim", "--config", str(CONFIG))
STUDY = """
from visavis import Compare, Factor, Rating, Study

study = Study(
    "short",
    "Does it show?",
    factors=[Factor("eyes", ["averted", "directed"])],
    repetitions=1,
    calibrate=False,
    uses=[],
    compare=[
        Compare(
            "liking",
            within="eyes",
            claim="Directed eyes are liked more",
            expects="directed > averted",
        )
    ],
)


@study.trial
def trial(t):
    yield t.dark(0.1)
    yield t.ask(Rating("liking", 1, 7))
"""
OF_LIKING = 'Compare(\n            "liking",'
BESIDES = f'Compare("liking_ms", within="eyes"), {OF_LIKING}'


@pytest.fixture(scope="module")
def studied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Lock a blinded study of four people; two take part, a comparison is added, two more."""
    root = tmp_path_factory.mktemp("locked")
    file = root / "short.py"
    file.write_text(STUDY, "utf-8")
    wanted = ("--participants", "4", "--rule", "As many as come.", "--blinded", *SIMULATED)
    ran("lock", str(file), *wanted, "--output", str(root / "out"), "--seed", "1")
    visavis.simulate(str(file), 2, output=root / "out", processes=1)
    return root


def ran(*arguments: str) -> str:
    result = CliRunner().invoke(app, list(arguments))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.output


def folder_of(root: Path) -> Path:
    return root / "out" / "simulated" / "short"


def test_a_locked_plan_is_read_by_people_and_by_programs(studied: Path) -> None:
    locked = read_lock(folder_of(studied))
    assert locked is not None
    page = (folder_of(studied) / PAGE_NAME).read_text("utf-8")
    content = json.loads((folder_of(studied) / LOCK_NAME).read_text("utf-8"))
    assert locked.sha256 == content["sha256"]
    assert f"`{locked.sha256}`" in page
    assert "liked more (`liking by eyes`), expected: directed > averted" in page
    assert "`liking by eyes`: test paired, α = 0.05, holm over family planned" in page
    assert "4 participants. As many as come." in page
    assert "- `max_bad_trials_01`: participants whose `bad_trials_01` is above 0.5" in page
    assert 4 == content["sample"]["participants"]


def test_a_plan_is_locked_once(studied: Path) -> None:
    with pytest.raises(UsageError, match="a locked plan is never changed"):
        ran(
            "lock",
            str(studied / "short.py"),
            "--participants",
            "9",
            *SIMULATED,
            "--output",
            str(studied / "out"),
        )


def test_a_blinded_study_shows_nothing_before_it_is_complete(studied: Path) -> None:
    folder = folder_of(studied)
    with pytest.raises(UsageError, match="hidden until 4 participants are complete; 2 are"):
        ran("analyse", str(folder), "--processes", "1")
    assert not (folder / "derived").exists()
    with pytest.raises(UsageError, match="--peek"):
        visavis.open_study(folder).analysis()
    ran("analyse", str(folder), "--processes", "1", "--peek", "the ethics board asked")
    page = (folder / "derived" / "report.html").read_text("utf-8")
    assert "with 2 sessions: the ethics board asked" in page
    assert "since this analysis" not in page


def test_the_one_deviation_is_named_and_what_is_added_is_exploratory(studied: Path) -> None:
    file, folder = studied / "short.py", folder_of(studied)
    file.write_text(STUDY.replace(OF_LIKING, BESIDES), "utf-8")
    visavis.simulate(str(file), 4, output=studied / "out", processes=1)
    told = ran("analyse", str(folder), "--processes", "1", "--set", "max_bad_trials_01=0.3")

    assert "1 deviation" in told
    deviations = pd.read_csv(folder / "derived" / "deviations.csv")
    assert [("exclusion max_bad_trials_01: limit", 0.5, 0.3, "this analysis")] == [
        (r["what"], float(r["planned"]), float(r["done"]), r["since"])
        for r in deviations.to_dict("records")
    ]
    page = (folder / "derived" / "report.html").read_text("utf-8")
    section = page[page.index('id="plan"') :]
    assert "directed &gt; averted" in section
    assert "4 of 4 sessions bear its hash" in section
    assert re.search(r"exclusion max_bad_trials_01: limit.*0\.5.*0\.3.*this an", section, re.S)
    assert "liking_ms by eyes" in section
    tests = pd.read_csv(folder / "derived" / "statistics.csv").set_index("measure")
    assert bool(tests.loc["liking_ms", "is_exploratory"])
    assert "not planned" == tests.loc["liking_ms", "family"]
    assert tests.loc["liking", "p_family"] == tests.loc["liking", "p"]


def test_a_deviation_that_sessions_recorded_counts_from_the_first_of_them(tmp_path: Path) -> None:
    file = tmp_path / "short.py"
    file.write_text(STUDY, "utf-8")
    data = visavis.simulate(str(file), 1, output=tmp_path, processes=1)
    chosen = visavis.open_study(data.path).study
    experiment = chosen.experiment({})
    lock_plan(data.path, chosen, experiment, 1, SimClock(), participants=3, sessions_before=1)
    file.write_text(STUDY.replace("claim=", "alpha=0.1, claim="), "utf-8")
    visavis.simulate(str(file), 3, output=tmp_path, processes=1)
    ran("analyse", str(data.path), "--processes", "1")
    deviations = pd.read_csv(data.path / "derived" / "deviations.csv").set_index("what")
    assert "S02C, 2000-01-01" == deviations.loc["comparison liking by eyes: alpha", "since"]
    assert "S01B, 2000-01-01" == deviations.loc["sessions without the plan's hash", "since"]
    assert "after 1 session had been recorded" in (data.path / "derived" / "report.html").read_text(
        "utf-8"
    )


def test_a_changed_byte_of_a_locked_plan_is_found_and_mended(studied: Path) -> None:
    folder = folder_of(studied)
    path = folder / LOCK_NAME
    whole = path.read_bytes()
    path.write_bytes(whole.replace(b'"participants": 4', b'"participants": 2'))
    with pytest.raises(DataError, match="its checksum disagrees"):
        read_lock(folder)
    assert any(LOCK_NAME in problem for problem in study_problems(folder))
    repair_study(folder)
    assert whole == path.read_bytes()


def test_families_of_tests_and_their_thresholds_are_frozen_too(tmp_path: Path) -> None:
    chosen = find_study("stare")
    experiment = chosen.experiment({})
    locked = lock_plan(tmp_path, chosen, experiment, 1, SimClock(), participants=30)
    assert len(chosen.study.analysis.families) == len(locked.plan["families"])  # type: ignore[attr-defined]  # stare is on the kit
    now = content_now(chosen, experiment, 1, {"alpha": 0.01})
    assert [("test rule alpha", "0.05", "0.01")] == [
        (d.what, d.planned, d.done) for d in deviations_between(locked.plan, now)
    ]
    assert "alpha 0.05" in (tmp_path / PAGE_NAME).read_text("utf-8")


def test_the_direction_of_a_locked_claim_cannot_be_turned_round_afterwards(studied: Path) -> None:
    file, folder = studied / "short.py", folder_of(studied)
    file.write_text(STUDY.replace("directed > averted", "averted > directed"), "utf-8")
    told = ran("analyse", str(folder), "--processes", "1", "--peek", "a look")

    what = "comparison liking by eyes: expects: planned directed > averted, done averted > directed"
    assert what in told
    tests = pd.read_csv(folder / "derived" / "statistics.csv").set_index("measure")
    assert "directed > averted" == tests.loc["liking", "expects"]
    file.write_text(STUDY, "utf-8")


ITEMS = """
from visavis import Factor, Image, Items, Rating, Study
study = Study("short", factors=[Factor("eyes", ["averted", "directed"])], items=Items("faces.csv"),
    repetitions=1, calibrate=False, uses=[], texts="words", after_block=["mood"])

@study.trial
def trial(t):
    yield t.show(Image(t.picture, 4, areas="areas.yaml"), 1)
    yield t.ask(Rating("liking", 1, 7))
"""
MOOD = """
name: mood
title: Mood
instruction: Now.
scale: {options: {1: low, 2: high}}
items: {calm: "How calm?"}
"""


def test_a_file_that_the_study_shows_or_asks_from_is_told_by_name_once_it_changed(
    tmp_path: Path,
) -> None:
    (tmp_path / "words").mkdir()
    (tmp_path / "words" / "en.yaml").write_text("instruction: Look.\n", "utf-8")
    (tmp_path / "mood.yaml").write_text(MOOD, "utf-8")
    (tmp_path / "faces.csv").write_text("picture\na.png\nb.png\n", "utf-8")
    (tmp_path / "areas.yaml").write_text("eye: {mask: painted.png, colour: red}\n", "utf-8")
    for name in ("a.png", "b.png"):
        Image.new("RGB", (40, 40), (1, 2, 3)).save(tmp_path / name)
    Image.new("RGB", (40, 40), (255, 0, 0)).save(tmp_path / "painted.png")
    file = tmp_path / "short.py"
    file.write_text(ITEMS, "utf-8")
    chosen = find_study(str(file))
    locked = lock_plan(tmp_path, chosen, chosen.experiment({}), 1, SimClock(), participants=3)  # type: ignore[arg-type]  # it is on the kit
    assert "`faces.csv`: SHA-256" in (tmp_path / PAGE_NAME).read_text("utf-8")

    def told() -> list[str]:
        now = find_study(str(file))
        content = content_now(now, now.experiment({}), 1)  # type: ignore[arg-type]
        return [d.what for d in deviations_between(locked.plan, content)]

    assert [] == told()
    (tmp_path / "faces.csv").write_text(
        "picture\na.png\na.png\nb.png\n".replace("a.png\na", "a"), "utf-8"
    )
    assert [] == told()  # the same bytes
    (tmp_path / "faces.csv").write_text("picture\nb.png\na.png\n", "utf-8")
    assert ["file faces.csv"] == told()
    Image.new("RGB", (40, 40), (3, 2, 1)).save(tmp_path / "b.png")
    assert ["file b.png", "file faces.csv"] == told()
    Image.new("RGB", (40, 40), (0, 255, 0)).save(tmp_path / "painted.png")
    (tmp_path / "areas.yaml").write_text("eye: {mask: painted.png, colour: '#00ff00'}\n", "utf-8")
    (tmp_path / "mood.yaml").write_text(MOOD.replace("calm?", "calm now?"), "utf-8")
    (tmp_path / "words" / "en.yaml").write_text("instruction: Look well.\n", "utf-8")
    names = ("areas.yaml", "b.png", "faces.csv", "mood.yaml", "painted.png", "words/en.yaml")
    assert [f"file {name}" for name in names] == told()
    file.write_text(ITEMS.replace('"areas.yaml"), 1)', '"areas.yaml"), 2)'), "utf-8")
    assert ["study file (what is shown or said)", *(f"file {name}" for name in names)] == told()
