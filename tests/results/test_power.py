"""Power and null runs of any study: the quick path, the study's rules, the family's correction."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.sessions import STUDIES, opened
from visavis.analysis.power import ANYTHING, PRIMARY, PowerRequest, jobs_of, run_job, summarise
from visavis.cli.commands.power import read_tests
from visavis.cli.quick_tracker import tracker_of
from visavis.lab.errors import DataError, UsageError
from visavis.results.power import KitPower, draw_people
from visavis.running.quick import quick_study
from visavis.study.comparisons import Compare

DUEL = str(STUDIES / "duel.py")


@pytest.fixture(scope="module")
def power() -> KitPower:
    return KitPower(DUEL, tracker_of, quick_study)


def test_parameters_of_a_study_hold_for_its_power() -> None:
    few = KitPower(DUEL, tracker_of, quick_study, overrides={"repetitions": 1})
    assert 4 == len(few.simulate_people([0], effect=1.0, seed=1))


@pytest.fixture(scope="module")
def people(power: KitPower) -> pd.DataFrame:
    return power.simulate_people(range(6), effect=1, seed=1)


def test_tests_are_the_planned_comparisons(power: KitPower) -> None:
    assert {"dwell_ms:gaze": "dwell_ms depends on gaze"} == dict(power.tests)


def test_terms_of_several_factors_are_effects_and_interactions() -> None:
    assert ("a",) == Compare("y", within="a").terms
    assert ("a", "b", "a:b") == Compare("y", within="a", between="b").terms


TWICE = """from visavis import Compare, Factor, Rating, Study

study = Study(
    "twice",
    factors=[Factor("side", ["left", "right"]), Factor("hue", ["red", "blue"])],
    calibrate=False,
    compare=[
        Compare("nice", within="side", only={"hue": "red"}),
        Compare("nice", within="side", only={"hue": "blue"}),
    ],
)


@study.trial
def trial(t):
    yield t.ask(Rating("nice", 1, 9))
"""


def test_two_comparisons_of_one_effect_each_have_a_power(tmp_path: Path) -> None:
    path = tmp_path / "twice.py"
    path.write_text(TWICE, "utf-8")
    twice = KitPower(str(path), tracker_of, quick_study)
    red, blue, primary, anything = twice.tests
    assert (primary, anything) == (PRIMARY, ANYTHING)
    assert ("nice:side (red, by side)", "nice:side (blue, by side)") == (red, blue)
    cells = {("left", "red"): 2, ("right", "red"): 7, ("left", "blue"): 5, ("right", "blue"): 5}
    rows = [
        {
            "participant": f"P{i}",
            "side": side,
            "hue": hue,
            "nice": nice + (i * (side == "left")) % 3,
        }
        for i in range(12)
        for (side, hue), nice in cells.items()
    ]
    tests = twice.resample(pd.DataFrame(rows), (12,), [red, blue], seed=1, alpha=0.001)[12]
    assert [True, False] == [tests[name].is_significant for name in (red, blue)]


@pytest.mark.parametrize(("above", "finds"), [(5.0, True), (0.0, False)])
def test_anything_is_found_where_one_headline_finds_something(
    tmp_path: Path, above: float, finds: bool
) -> None:
    path = tmp_path / "twice.py"
    path.write_text(TWICE, "utf-8")
    twice = KitPower(str(path), tracker_of, quick_study)
    rows = pd.DataFrame(
        {
            "participant": f"P{i:02d}",
            "side": side,
            "hue": hue,
            "nice": (side == "left") * (i % 3 - 1 + above * (hue == "red")),
        }
        for i in range(12)
        for side in ("left", "right")
        for hue in ("red", "blue")
    )
    verdict = twice.resample(rows, (12,), [ANYTHING], seed=1, alpha=0.001)[12][ANYTHING]
    assert finds == verdict.is_significant


def test_without_an_effect_the_whole_study_is_asked_too(tmp_path: Path) -> None:
    path = tmp_path / "twice.py"
    path.write_text(TWICE, "utf-8")
    twice = KitPower(str(path), tracker_of, quick_study)
    assert (PRIMARY, ANYTHING) == read_tests(twice, None, 0.0)[-2:]
    assert ANYTHING not in read_tests(twice, None, 1.0)
    assert ANYTHING not in read_tests(KitPower(DUEL, tracker_of, quick_study), None, 0.0)


CLAIMED = """from visavis import Compare, Factor, Rating, Study

study = Study(
    "near",
    factors=[Factor("motion", ["idle", "wave"]), Factor("far_m", [1.5, 3.0])],
    compare=[
        Compare(
            "nice",
            within=["motion", "far_m"],
            claim="waving is nicer when near",
            expects="motion: wave > idle; far_m: 1.5 > 3.0",
        )
    ],
)


@study.trial
def trial(t):
    yield t.ask(Rating("nice"))
"""


def test_a_claim_is_put_to_the_interaction_which_decides_and_other_effects_are_named(
    tmp_path: Path,
) -> None:
    (tmp_path / "near.py").write_text(CLAIMED, "utf-8")
    near = KitPower(str(tmp_path / "near.py"), tracker_of, quick_study)
    assert {
        "nice:motion:far_m": "nice depends on motion × far_m: waving is nicer when near "
        "(motion: wave > idle; far_m: 1.5 > 3.0)",
        "nice:motion": "nice depends on motion",
        "nice:far_m": "nice depends on far_m",
        PRIMARY: "any primary claim finds something",
        ANYTHING: "any headline finds something",
    } == dict(near.tests)
    assert "nice:motion:far_m" == near.shown_tests[0]


@pytest.mark.parametrize("term", ["motion:far_m", "far_m:motion"])
def test_a_claim_is_about_the_effect_of_all_factors(term: str) -> None:
    of = Compare(
        "nice",
        within=["motion", "far_m"],
        claim="waving is nicer when near",
        expects="motion: wave > idle; far_m: 1.5 > 3.0",
    )
    assert (True, False) == (of.is_claimed(term), of.is_claimed("motion"))


ONE_WAY = """from visavis import Compare, Factor, Rating, Study

study = Study(
    "one_way",
    factors=[Factor("motion", ["idle", "wave"])],
    calibrate=False,
    compare=[Compare("nice", within="motion", claim="waving is nice", expects="wave > idle")],
)


@study.trial
def trial(t):
    yield t.ask(Rating("nice", 1, 9))
"""


@pytest.mark.parametrize(("lift", "succeeds"), [(3.0, True), (-3.0, False), (0.0, False)])
def test_power_counts_a_claim_only_in_its_direction(
    tmp_path: Path, lift: float, succeeds: bool
) -> None:
    (tmp_path / "one_way.py").write_text(ONE_WAY, "utf-8")
    one_way = KitPower(str(tmp_path / "one_way.py"), tracker_of, quick_study)
    assert {"nice:motion": "waving is nice (wave > idle)"} == dict(one_way.tests)
    rng = np.random.default_rng(1)
    rows = pd.DataFrame(
        {
            "participant": f"P{i}",
            "motion": motion,
            "nice": 5.0 + lift * (motion == "wave") + rng.normal(),
        }
        for i in range(12)
        for motion in ("idle", "wave")
    )
    tests = one_way.resample(rows, (12,), ["nice:motion"], seed=1, alpha=0.05)[12]["nice:motion"]
    assert succeeds is tests.is_significant
    assert lift == 0.0 or np.sign(lift) == np.sign(tests.difference)


def test_people_of_the_quick_path_are_those_of_sessions(people: pd.DataFrame) -> None:
    plan = opened("duel").experiment({}).plan(2, 1)
    mine = people[people["participant"] == "00002"]
    planned = [t.trial_id for t in plan.trials if not t.is_practice]
    assert planned == mine["trial_id"].tolist()
    assert mine["dwell_ms"].between(0, 4000).all()
    assert mine["realism"].between(1, 9).all()


def test_directed_gaze_is_looked_at_longer_only_with_the_effect(
    power: KitPower, people: pd.DataFrame
) -> None:
    with_effect = people.groupby("gaze")["dwell_ms"].mean()
    without = power.simulate_people(range(6), effect=0, seed=1).groupby("gaze")["dwell_ms"].mean()
    assert with_effect["directed"] > 1.5 * with_effect["averted"]
    assert 0.7 < without["directed"] / without["averted"] < 1.4


def test_power_is_found_in_a_pool_and_does_not_depend_on_the_jobs(
    power: KitPower, people: pd.DataFrame
) -> None:
    request = PowerRequest((6, 12), ("dwell_ms:gaze",), 8, 1.0, 0.05, 3)
    tests = [
        summarise(
            power,
            request,
            [r for job in jobs_of(power, request, size=size, people=people) for r in run_job(job)],
            source="simulated pool",
            people_are_simulated=True,
        )
        for size in (3, 8)
    ]
    assert tests[0].tests == tests[1].tests
    assert tests[0].tests[0].difference > 100


def test_drawn_people_keep_all_their_rows_and_get_numbers() -> None:
    rows = pd.DataFrame({"participant": ["a", "a", "b"], "x": [1, 2, 3]})
    sample = draw_people(rows, 4, np.random.default_rng(0))
    assert {"00000", "00001", "00002", "00003"} == set(sample["participant"])
    assert {(1, 2), (3,)} >= {tuple(g["x"]) for _, g in sample.groupby("participant")}


def test_effect_between_none_and_published_is_refused(power: KitPower) -> None:
    with pytest.raises(UsageError, match="published or none"):
        power.simulate_people([0], effect=0.5, seed=1)


def test_folder_without_a_table_says_how_to_make_it(power: KitPower, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="visavis analyse"):
        power.people_of(tmp_path, effect=1)


TIMES = """
from visavis import Compare, Factor, Keys, Race, Study, Text
study = Study("timed", factors=[Factor("size", [1, 2])], calibrate=False,
    compare=[Compare("answer_ms", within="size"), Compare("answer_is_right", within="size")])

@study.trial
def trial(t):
    yield t.show(Text("x", height_deg=t.size), until=Keys("r", "g", right="r"), limit_s=2)
"""


@pytest.mark.parametrize(
    ("imports", "answer", "expected"),
    [
        ("", "", ("answer_ms",)),
        ("", "'r'", ("answer_ms",)),
        ("Race, ", "Race({'r': 2.0, 'g': 1.0})", ()),
        ("Race, ", "None and Race({'r': 2.0}) or 'r'", ("answer_ms",)),  # named, and never run
        ("Race, ", "Race({'r': 2.0}) if rng.random() < 0.5 else 'g'", ("answer_ms",)),
        ("Race, ", "Race({'r': 2.0}) if rng.random() < 0.9 else None", ()),
        ("Race, ", "__import__('other').answered()", ()),
    ],
)
def test_power_of_times_that_no_model_makes_cannot_be_known(
    tmp_path, monkeypatch, imports, answer, expected
):
    text = TIMES.replace("Race, ", imports).replace("calibrate", "repetitions=8, calibrate")
    other = "from visavis import Race\ndef answered():\n    return Race({'r': 1.0})\n"
    (tmp_path / "other.py").write_text(other, "utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    if answer:
        text += f"\n@study.answer\ndef answer(seen, response, rng):\n    return {answer}\n"
    (tmp_path / "timed.py").write_text(text, "utf-8")
    power = KitPower(str(tmp_path / "timed.py"), tracker_of, quick_study)
    assert expected == power.unplanted_times
