"""A comparison without a factor holds one measure against a number: sign, binomial, t, tost."""

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from visavis.cli.quick_tracker import tracker_of
from visavis.lab.errors import DesignError
from visavis.results.analysis import answer_comparison
from visavis.results.power import KitPower
from visavis.running.quick import quick_study
from visavis.study.comparisons import Compare
from visavis.study.measures import Measure

STUDY = """from visavis import Compare, Factor, Rating, Study

study = Study(
    "votes",
    factors=[Factor("side", ["left", "right"])],
    calibrate=False,
    compare=[
        Compare(
            "vote",
            test="sign",
            options=[("mu", 3)],
            claim="the hybrid is preferred",
            expects="vote > 3",
        )
    ],
)


@study.trial
def trial(t):
    yield t.ask(Rating("vote", 1, 5))


@study.answer
def answer(seen, response, rng):
    return int(rng.choice([4, 5])) if seen.effect else int(rng.integers(1, 6))
"""
VOTES = (2.0, 1.0, 1.0, 2.0, 0.0, 1.0, -1.0, 2.0, 1.0, 1.0, 2.0)


def _answered(test: str, values: tuple[float, ...], **options: float) -> dict[str, Any]:
    rows = pd.DataFrame({"participant": f"P{i}", "vote": v} for i, v in enumerate(values))
    usual = 0.5 if test == "binomial" else 0.0
    of = Compare(
        "vote",
        test=test,
        options=tuple(options.items()),
        claim="it is preferred",
        expects="" if test == "tost" else f"vote > {options.get('mu', usual)}",
    )
    finding = answer_comparison(
        of, rows, {"vote": Measure("vote", "1", "vote")}, {}, is_simulated=True
    )
    assert ("vote",) == of.terms == tuple(term.name for term in finding.terms), finding.why_not
    return dict(finding.terms[0].row)


def test_a_measure_alone_has_the_p_of_r() -> None:
    # binom.test(9, 10), binom.test(8, 10), t.test(x), the greater of two t.test(x, mu = -2 or 2)
    assert 0.0214843750 == pytest.approx(_answered("sign", VOTES)["p"], abs=1e-9)
    assert 0.1093750000 == pytest.approx(
        _answered("binomial", (1.0,) * 8 + (0.0,) * 2, mu=0.5)["p"], abs=1e-9
    )
    assert 0.0033012322626 == pytest.approx(_answered("t", VOTES)["p"], abs=1e-9)
    assert 0.0047912999816 == pytest.approx(_answered("tost", VOTES, low=-2, high=2)["p"], abs=1e-9)


@pytest.mark.parametrize(
    ("given", "asked"),
    [({}, "within="), ({"test": "friedman"}, "within="), ({"test": "sign"}, "claim=")],
)
def test_without_a_factor_a_test_of_one_sample_and_a_claim_are_asked_for(
    given: dict[str, str], asked: str
) -> None:
    with pytest.raises(DesignError, match=asked):
        Compare("vote", **given)  # type: ignore[arg-type]  # names of tests


@pytest.fixture(scope="module")
def votes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("votes") / "votes.py"
    path.write_text(STUDY, "utf-8")
    return path


def test_its_power_is_found(votes: Path) -> None:
    power = KitPower(str(votes), tracker_of, quick_study)
    assert {"vote:vote": "the hybrid is preferred (vote > 3)"} == dict(power.tests)
    people = pd.DataFrame({"participant": f"P{i}", "vote": v} for i, v in enumerate((4, 5) * 5))
    # All of five above 3 is p = 2 / 2^5, not below .05; of eight it is 2 / 2^8.
    finding = power.resample(people, (5, 8), ["vote:vote"], seed=1, alpha=0.05)
    assert [False, True] == [finding[n]["vote:vote"].is_significant for n in (5, 8)]
