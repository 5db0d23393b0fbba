"""A comparison can be about some people or trials, or be repeated by groups as one family."""

from pathlib import Path

import pandas as pd
import pytest

from visavis.analysis.power import ANYTHING, PRIMARY
from visavis.cli.quick_tracker import tracker_of
from visavis.lab.errors import DataError, DesignError
from visavis.results.analysis import answer_comparison, rows_to_compare, with_corrected_p
from visavis.results.claims import answer_claim
from visavis.results.findings import Finding
from visavis.results.opened_study import find_study
from visavis.results.power import KitPower
from visavis.running.quick import quick_study
from visavis.study.comparisons import Compare, possible
from visavis.study.conditions import condition_of, fulfils, with_people
from visavis.study.measures import Measure

METHODS = ("lineuler", "slerp", "squad")
RATED = {  # what everybody answered about animation, and three ratings
    "P00": (4, 3.5, 3.52, 5.1),
    "P01": (4, 3.1, 3.68, 5.03),
    "P02": (4, 2.58, 2.81, 2.92),
    "P03": (4, 2.58, 2.89, 3.55),
    "P04": (4, 4.06, 3.38, 4.13),
    "P05": (3, 2.46, 2.68, 3.1),
    "P06": (1, 3.19, 3.58, 4.25),
    "P07": (2, 2.82, 3.05, 3.34),
    "P08": (3, 3.1, 3.11, 3.11),
    "P09": (1, 3.43, 3.83, 4.42),
    "P10": (2, 2.85, 2.97, 2.64),
    "P11": (3, 1.46, 3.29, 3.18),
    "P12": (1, 2.25, 2.7, 2.48),
    "P13": (2, 4.26, 3.54, 3.52),
    "P14": (3, 2.06, 3.52, 3.07),
}
GROUPS = {"experience": {"novice": "animation < 4", "experienced": "animation = 4"}}
BY = Compare(
    "naturalness",
    within="method",
    test="rm",
    options=[("correction", "none")],
    by="experience",
    family="groups",
    claim="Squad looks most natural",
    expects="squad > slerp, lineuler",
)


def _trials() -> pd.DataFrame:
    return pd.DataFrame(
        {"participant": who, "method": method, "naturalness": value}
        for who, (_, *values) in RATED.items()
        for method, value in zip(METHODS, values, strict=True)
    )


def _people() -> pd.DataFrame:
    return pd.DataFrame({"participant": w, "animation": a} for w, (a, *_) in RATED.items())


def _answers(compare: Compare, people: pd.DataFrame | None = None) -> tuple[Finding, ...]:
    levels = {"method": METHODS, "experience": ("novice", "experienced")}
    parts = possible([compare], {"method": METHODS}, ("method",), (), GROUPS)
    people = _people() if people is None else people
    return with_corrected_p(
        [
            answer_comparison(
                part,
                rows_to_compare(part, _trials(), people, GROUPS),
                {"naturalness": Measure("naturalness", "1", "Naturalness")},
                levels,
                is_simulated=False,
            )
            for part in parts
        ]
    )


def test_each_group_and_the_interaction_have_the_p_of_r_and_share_holm() -> None:
    # aov(naturalness ~ method + Error(participant/method)) of each group; afex::aov_ez, type III
    alone = [0.037331, 0.015399, 0.083480283801704]
    corrected = [2 * 0.037331, 3 * 0.015399, 0.083480283801704]
    findings = _answers(BY)
    terms = [term for finding in findings for term in finding.terms]
    assert ["method", "method", "experience:method"] == [t.name for t in terms]
    assert pytest.approx(alone, abs=1e-6) == [t.p for t in terms]
    assert pytest.approx(corrected, abs=3e-6) == [t.p_corrected for t in terms]


def test_a_claim_is_about_every_group_and_not_about_their_interaction() -> None:
    novice, experienced, interaction = (f.compare for f in _answers(BY))
    assert "squad > slerp, lineuler" == novice.expects == experienced.expects
    assert ("", "") == (interaction.claim, interaction.expects)
    assert ("naturalness by method (novice)", "naturalness by method (experienced)") == (
        novice.name,
        experienced.name,
    )
    assert interaction.name == "naturalness by method × experience"


def test_a_test_of_one_factor_leaves_its_interaction_to_the_design() -> None:
    compare = Compare("naturalness", within="method", test="friedman", by="experience")
    tests = [f.outcome.question.test for f in _answers(compare) if f.outcome is not None]
    assert ["friedman", "friedman", "art"] == tests


def test_where_chooses_people_by_what_they_answered() -> None:
    by_group = _answers(BY)[1].terms[0].p
    where = Compare(
        "naturalness",
        within="method",
        test="rm",
        where="animation = 4",
        options=[("correction", "none")],
    )
    (finding,) = _answers(where)
    assert by_group == finding.terms[0].p
    assert finding.compare.name == "naturalness by method (animation = 4)"


def test_who_is_in_no_group_is_counted_and_in_no_test() -> None:
    people = _people()
    people.loc[people["participant"].isin(("P13", "P14")), "animation"] = None
    novice, _, interaction = _answers(BY, people)
    assert novice.outcome is not None
    assert interaction.outcome is not None
    assert 8 == novice.outcome.data["participant"].nunique()  # type: ignore[index]  # it was tested
    assert "left out: 2 participants in no group of this comparison" in interaction.outcome.notes


def test_a_group_of_nobody_is_not_tested_and_says_so() -> None:
    novice, experienced, _ = _answers(BY, _people()[["participant"]])
    assert novice.terms == experienced.terms == ()
    assert novice.why_not == "no trial of novice counts"


@pytest.mark.parametrize(
    ("text", "those"),
    [
        ("age = 30", ["a"]),
        ("age = 30, 40", ["a", "b"]),
        ("age != 30", ["b"]),
        ("age >= 40", ["b"]),
        ("prolific", ["a"]),
    ],
)
def test_a_missing_value_fulfils_no_condition(text: str, those: list[str]) -> None:
    rows = pd.DataFrame(
        {"who": ["a", "b", "c"], "age": [30.0, 40.0, None], "prolific": [True, False, None]}
    )
    assert those == list(rows["who"][fulfils(rows, condition_of(text, "here"))])


def test_levels_that_share_somebody_are_refused() -> None:
    both = {"experience": {"novice": "animation < 4", "experienced": "animation > 2"}}
    with pytest.raises(DataError, match=r"P05 is novice and experienced of experience"):
        rows_to_compare(Compare("naturalness", between="experience"), _trials(), _people(), both)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"where": "animation ~ 4"}, "is no condition"),
        ({"where": "animation > much"}, "no number"),
        ({"by": "method", "only": {"method": "squad"}}, "only="),
        ({"by": "experience", "test": "tost"}, "where="),
    ],
)
def test_a_subset_that_makes_no_sense_is_refused(given: dict[str, str], says: str) -> None:
    with pytest.raises(DesignError, match=says):
        Compare("naturalness", within="method", **given)  # type: ignore[arg-type]  # wrong on purpose


STUDY = """from visavis import Compare, Factor, Rating, Study

study = Study(
    "looks",
    factors=[Factor("method", ["slerp", "squad"])],
    calibrate=False,
    questionnaires=["demographics"],
    groups={"age_group": {"younger": "age < 40", "older": "age >= 40"}},
    compare=[
        Compare("natural", within="method", expects="squad > slerp"),
        Compare("natural", within="method", by="age_group", expects="squad > slerp"),
        Compare("natural", within="method", where="age >= 18"),
    ],
)


@study.trial
def trial(t):
    yield t.ask(Rating("natural", 1, 5))
"""


def test_power_asks_simulated_people_and_names_every_subset(tmp_path: Path) -> None:
    path = tmp_path / "looks.py"
    path.write_text(STUDY, encoding="utf-8")
    power = KitPower(str(path), tracker_of, quick_study)
    names = list(power.tests)
    assert [
        "natural:method",
        "natural:method (younger, by method)",
        "natural:method (older, by method)",
        "natural:method:age_group",
        "natural:method (age >= 18, by method)",
        PRIMARY,
        ANYTHING,
    ] == names
    rows = power.simulate_people(range(12), effect=1, seed=3)
    assert "age" in rows
    verdicts = power.simulate([12], names, effect=1, seed=3, alpha=0.05)[12]
    assert names == list(verdicts)
    assert verdicts["natural:method:age_group"].is_significant is not None


@pytest.mark.parametrize("slip", ["age <", "aeg <"])
def test_a_column_that_nobody_has_is_refused_by_line(tmp_path: Path, slip: str) -> None:
    path = tmp_path / "looks.py"
    path.write_text(STUDY.replace("age < 40", f"{slip} 40"), encoding="utf-8")
    if slip == "age <":
        assert find_study(str(path)).experiment({}).compare
        return
    with pytest.raises(DesignError, match=r"there is no column 'aeg'.*age"):
        find_study(str(path)).experiment({})


def test_simple_effects_are_planned_in_a_study_and_those_of_r() -> None:
    compare = Compare(
        "naturalness",
        within="method",
        between="experience",
        test="rm",
        simple="method",
        options=[("always_posthoc", True)],
    )
    (finding,) = _answers(compare)
    assert finding.outcome is not None
    rows = [r for r in finding.outcome.contrasts if str(r["family"]).startswith("method at")]
    # pairs(emmeans(lm(cbind(lineuler, slerp, squad) ~ experience), ~ method | experience))
    ts = [-2.114, -2.223, -0.580, -0.313, -2.951, -4.344]
    ps = [0.1337, 0.1337, 0.5719, 0.7591, 0.0225, 0.0024]
    assert ["method at experience = novice"] * 3 == [r["family"] for r in rows[:3]]
    assert pytest.approx(ts, abs=5e-4) == [r["t"] for r in rows]
    assert pytest.approx(ps, abs=5e-5) == [r["p_adjusted"] for r in rows]
    assert not [r for r in finding.outcome.contrasts if r["family"] == "experience:method"]


@pytest.mark.parametrize(
    "given",
    [{"within": "method"}, {"within": ("a", "b")}, {"within": ("method", "b"), "test": "t"}],
)
def test_simple_effects_need_another_factor(given: dict[str, str]) -> None:
    with pytest.raises(DesignError, match="has no simple effects"):
        Compare("naturalness", simple="method", **given)  # type: ignore[arg-type]  # wrong on purpose


def test_what_people_answered_is_held_constant_and_differences_are_adjusted() -> None:
    compare = Compare(
        "naturalness",
        between="half",
        options=[("covariates", "animation")],
        claim="the second half rates higher",
        expects="second > first",
    )
    trials = _trials().assign(
        half=lambda t: t["participant"].map(lambda w: ("first", "second")[int(w[1:]) % 2])
    )
    finding = answer_comparison(
        compare,
        rows_to_compare(compare, trials, _people(), {}),
        {"naturalness": Measure("naturalness", "1", "Naturalness")},
        {"half": ("first", "second")},
        is_simulated=False,
    )
    (term,) = with_corrected_p([finding])[0].terms
    # m <- lm(mean ~ half + animation); car::Anova(m, type = 3); pairs(emmeans(m, "half"))
    assert ("half", pytest.approx(0.762514512174, abs=1e-9)) == (term.name, term.p)
    (difference,) = answer_claim(finding).differences
    assert pytest.approx(0.094, abs=1e-9) == difference.value
    assert difference.interval is not None
    assert pytest.approx(-0.568503820, abs=1e-8) == difference.interval.low
    assert "with animation held constant" in finding.outcome.title  # type: ignore[union-attr]  # it was tested


def test_nobody_is_in_two_levels_of_a_group_in_different_trials() -> None:
    trials = pd.DataFrame({"participant": ["P1", "P1", "P2"], "rt": [2.0, 7.0, 3.0]})
    groups = {"fast": {"quick": "rt < 5", "slow": "rt >= 5"}}
    with pytest.raises(DataError, match="P1 is quick and slow of fast in different trials"):
        with_people(trials, None, (), groups)
    assert list(with_people(trials[1:], None, (), groups)["fast"]) == ["slow", "quick"]
