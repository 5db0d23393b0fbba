"""What a report says of a study with a rating: in words, by labels, true to its recordings."""

import re
from html import unescape
from pathlib import Path

import pytest

from tests.sessions import opened, perform
from visavis.results.analysis import measures_of
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.results.report.methods import own_methods
from visavis.study.measures import dwell_on

STUDY = """from visavis import Compare, Factor, Rating, Scene, Study, dwell_on

study = Study(
    "mood",
    factors=[Factor("far_m", [1.0, 2.5]), Factor("eyes", ["averted", "directed"])],
    practice=1,
    texts="texts",
    measures=[dwell_on("person")],
    compare=[
        Compare(
            "comfort",
            within=["far_m", "eyes"],
            claim="Distance calms",
            expects="far_m: 2.5 > 1.0",
        ),
        Compare("dwell_ms", within="eyes"),
        Compare("dwell_ms", within="eyes", only={"far_m": 2.5}),
    ],
)


@study.trial
def trial(t):
    yield t.show(Scene("person", distance_m=t.far_m, eyes=t.eyes), seconds=0.5)
    yield t.ask(Rating("comfort", 1, 9))
"""
TEXTS = "labels:\n  far_m: distance in metres\n  eyes: gaze of the person\n"


@pytest.mark.parametrize(
    ("expected", "repetitions"),
    [
        ("Every combination came once: 2 trials", 1),
        ("Every combination came 3 times: 6 trials", 3),
    ],
)
def test_the_method_says_how_often_every_combination_came(expected: str, repetitions: int) -> None:
    experiment = opened("asking").experiment({"repetitions": repetitions})
    assert expected in " ".join(own_methods(experiment))


@pytest.mark.parametrize(
    ("expected", "name"),
    [
        (
            "Each block held one gesture. Blocks came in the order of a row of a Williams square, "
            "by participant, and the trials of a block in random order.",
            "interpolation",
        ),
        (
            "Blocks came in a fixed order, the same for everybody, "
            "and the trials of a block in random order.",
            "crowd",
        ),
        ("Trials came in random order.", "hybrid"),
        (
            "Trials came in random order, with equally many of every level in each block.",
            "stare",
        ),
    ],
)
def test_the_method_says_one_order_of_blocks_and_of_trials(expected: str, name: str) -> None:
    study = find_study(name)
    assert isinstance(study, OpenedStudy)
    said = " ".join(own_methods(study.experiment({})))
    assert expected in said
    assert 1 == said.count("random order")


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("mood")
    (folder / "texts").mkdir()
    (folder / "texts" / "en.yaml").write_text(TEXTS, "utf-8")
    path = folder / "mood.py"
    path.write_text(STUDY, "utf-8")
    study = opened(str(path))
    recordings = [perform(str(path), folder / "data", index, intertrial_s=0.1) for index in (0, 1)]
    page = study.analyse(
        [study.measure(r) for r in recordings],
        folder / "out",
        is_simulated=True,
        commands=(),
        example=recordings[0],
    ).read_text("utf-8")
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", page)))


def test_the_sampling_rate_is_told_of_every_study_with_gaze(said: str) -> None:
    assert re.search(
        r"Sampling rate, nominal and effective \d+ Hz nominal, \d+\.\d Hz effective", said
    )


def test_a_claim_is_read_in_the_report(said: str) -> None:
    assert "Comfort: not tested – distance calms" in said


def test_the_checklist_is_true_to_the_session(said: str) -> None:
    assert "before the first block; validation again at the end" in said
    assert "Validations rejected none" in said
    assert re.search(r"Tracking of head and body: devices, rates .*? \(headset, \d+ Hz\)", said)
    assert "0 of 8; see Participants" in said
    assert "repeated_samples" not in said


def test_words_stand_where_columns_stood(said: str) -> None:
    assert "person person" not in said
    assert "comfort by distance in metres × gaze of the person" in said
    assert "Data loss with distance in metres 1.0" in said
    assert (
        "trials with share of the scene without usable gaze (max_trial_lost_01) above 0.5" in said
    )
    assert "dwell_ms by" not in said


def test_a_figure_of_some_trials_says_of_which(said: str) -> None:
    assert 1 == said.count("Only trials with distance in metres 2.5 are shown.")


def test_a_rating_is_drawn_over_its_whole_scale(tmp_path: Path) -> None:
    (tmp_path / "mood.py").write_text(STUDY.replace('    texts="texts",\n', ""), "utf-8")
    experiment = opened(str(tmp_path / "mood.py")).experiment({})
    found = {m.column: m.scale for m in measures_of(experiment.study, experiment.responses)}

    assert (1, 9) == found["comfort"]
    assert found["dwell_ms"] is None


def test_a_role_in_words_says_person_once() -> None:
    assert "Dwell time on the person" == dwell_on("person").words
    assert "Dwell time on the active person" == dwell_on("active").words
    assert "Dwell time on the front left person" == dwell_on("front_left").words


WARM = """from visavis import Compare, Factor, Rating, Scene, Study

study = Study(
    "warm",
    factors=[Factor("eyes", ["averted", "directed"])],
    repetitions=4,
    texts="texts",
    calibrate=False,
    compare=[Compare("comfort", within="eyes")],
)


@study.trial
def trial(t):
    yield t.show(Scene("person", eyes=t.eyes), seconds=0.1)
    yield t.ask(Rating("comfort", 1, 9))


@study.answer
def answer(seen, response, rng):
    liked = seen.looked_at_me_01[0] > 0.5
    return int(min(9, max(1, round(rng.normal(8 if liked else 2, 0.7)))))
"""


def test_headline_and_sentence_call_levels_alike_and_give_both_means(tmp_path: Path) -> None:
    (tmp_path / "texts").mkdir()
    labels = "labels:\n  eyes: gaze\n  directed: at the participant\n"
    (tmp_path / "texts" / "en.yaml").write_text(labels, "utf-8")
    path = tmp_path / "warm.py"
    path.write_text(WARM, "utf-8")
    study = opened(str(path))
    recordings = [
        perform(str(path), tmp_path / "data", index, intertrial_s=0.1) for index in range(4)
    ]
    page = study.analyse(
        [study.measure(r) for r in recordings],
        tmp_path / "out",
        is_simulated=True,
        commands=(),
        example=recordings[0],
    ).read_text("utf-8")
    said = re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", page)))

    high, low = r"[78]\.\d\d", r"[12]\.\d\d"
    assert re.search(
        rf"Comfort: more with gaze at the participant than averted "
        rf"\({high} and {low}, difference \d\.\d\d, 95% CI \[",
        said,
    )
    assert re.search(
        rf"averted and at the participant differ \(means {low} and {high}\): paired t test of "
        r"averted − at the participant, t\(3\) = −\d",
        said,
    )
    assert "directed" not in said.split("Methods")[0]
