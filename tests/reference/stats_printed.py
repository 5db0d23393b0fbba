"""Map published values to the checker, and results without data to what follows from them."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from tests.reference import stats_papers
from tests.reference.stats_compare import Failure, Outcome, compare, total
from visavis.analysis.statistics import (
    PublishedCheck,
    adjust_p,
    published,
    studentized_range_sf,
)

Item = Mapping[str, Any]
DEFAULT_TOLERANCE = {"rel": 1e-9, "abs": 1e-12}


def check_item(where: str, item: Item) -> Outcome:
    """Compare computed values, rounding intervals and verdicts of one published item."""
    mapped = PUBLISHED.get(item["kind"])
    if mapped is None:
        return Outcome(1, (Failure(where, item["kind"], "no call for this kind"),))
    check, values, verdicts = mapped(item)
    tolerance = item.get("tolerance", DEFAULT_TOLERANCE)
    parts = [compare(f"{where}.expected", item["expected"], values, tolerance)]
    for name, consistent in item["consistent"].items():
        got = verdicts.get(name)
        fits = got is not None and got == consistent
        failure = Failure(f"{where}.consistent.{name}", consistent, got)
        parts.append(Outcome(1, () if fits else (failure,)))
    for name, interval in item.get("interval_from_rounding", {}).items():
        verdict = check.verdicts.get(name)
        got_interval = None if verdict is None else list(verdict.interval or ())
        parts.append(
            compare(f"{where}.interval.{name}", sorted(interval), got_interval, {"rel": 1e-6})
        )
    return total(parts)


Mapped = tuple[PublishedCheck, Mapping[str, Any], Mapping[str, bool]]


def _plain(check: PublishedCheck, **renamed: str) -> Mapped:
    values = {renamed.get(k, k): v for k, v in check.values.items()}
    return check, values, {k: v.is_consistent for k, v in check.verdicts.items()}


def _f(item: Item) -> Mapped:
    i, printed = item["inputs"], item["printed"]
    return _plain(
        published.check_f(i["F"], i["df1"], i["df2"], p=printed.get("p"), eta=printed.get("eta2p"))
    )


def _t(item: Item) -> Mapped:
    i, printed = item["inputs"], item["printed"]
    return _plain(published.check_t(i["t"], i["df"], p=printed.get("p"), eta=printed.get("eta2p")))


def _paired_summary(item: Item) -> Mapped:
    i = item["inputs"]
    return _plain(
        stats_papers.check_paired_summary(
            i["mean_1"], i["sd_1"], i["mean_2"], i["sd_2"], i["t"], i["n"]
        )
    )


def _independent_summary(item: Item) -> Mapped:
    i = item["inputs"]
    n_1, n_2 = i.get("n1", i.get("n")), i.get("n2", i.get("n"))
    return _plain(
        stats_papers.check_independent_t(
            i["m1"], i["s1"], n_1, i["m2"], i["s2"], n_2, t=item["printed"].get("t")
        )
    )


def _spearman(item: Item) -> Mapped:
    i = item["inputs"]
    return _plain(stats_papers.check_spearman(i["rs"], i["n"], p=item["printed"].get("p")))


def _threshold(item: Item) -> Mapped:
    i = item["inputs"]
    return _plain(
        stats_papers.check_threshold(i["alpha"], i["m"], threshold=item["printed"].get("threshold"))
    )


def _stars(item: Item) -> Mapped:
    i = item["inputs"]
    check = stats_papers.check_stars(i["p"], i["m"], printed=item["printed"].get("stars"))
    verdicts = {k: v.is_consistent for k, v in check.verdicts.items()}
    return check, {"stars": "*" * int(check.values["stars"])}, verdicts


def _integer_mean(item: Item) -> Mapped:
    i = item["inputs"]
    check = published.check_integer_mean(i["mean"], i["n"], decimals=i.get("decimals"))
    values = {**check.values, "possible": check.is_consistent}
    return check, values, {"mean": check.is_consistent}


def _means_and_p(item: Item) -> Mapped:
    i = item["inputs"]
    names = _group_names(item["expected"], len(i["means"]))
    printed = item["printed"].get("tukey")
    check = published.check_oneway_from_means(
        i["p"],
        i["means"],
        i["n_per_group"],
        names=names,
        significant=stats_papers.read_verdicts(printed) if printed else None,
    )
    return check, check.values, {"tukey": check.is_consistent and bool(check.verdicts)}


def _group_names(expected: Mapping[str, Any], k: int) -> list[str]:
    """Return group names in the order of the means, from keys tukey_SECOND_FIRST."""
    pairs = [key.removeprefix("tukey_").split("_") for key in expected if key.startswith("tukey_")]
    earlier = {name: sum(p[0] == name for p in pairs) for pair in pairs for name in pair}
    names = sorted(earlier, key=lambda name: earlier[name])
    return names if len(names) == k else [str(i + 1) for i in range(k)]


def _pooled_mean(item: Item) -> Mapped:
    return _plain(stats_papers.check_pooled_mean(item["inputs"], mean=item["printed"].get("mean")))


def _power(item: Item) -> Mapped:
    i = item["inputs"]
    check = stats_papers.check_oneway_power(
        i["k"],
        i["n_for_80_percent"],
        i["n_used"],
        alpha=i.get("alpha", 0.05),
        power=item["printed"].get("power"),
    )
    return _plain(check, power=f"power_at_{i['n_used']}")


def _signed_rank(item: Item) -> Mapped:
    i = item["inputs"]
    return _plain(
        stats_papers.check_signed_rank(
            i["T"],
            i["n"],
            p=item["printed"].get("p"),
            continuity=i.get("continuity_correction", False),
        )
    )


PUBLISHED: Mapping[str, Callable[[Item], Mapped]] = {
    "F": _f,
    "t": _t,
    "paired_t_from_summary": _paired_summary,
    "independent_t_from_summary": _independent_summary,
    "spearman": _spearman,
    "bonferroni_alpha": _threshold,
    "bonferroni_stars": _stars,
    "mean_of_integers_possible": _integer_mean,
    "oneway_anova_from_means_and_p": _means_and_p,
    "pooled_mean": _pooled_mean,
    "power_oneway_anova": _power,
    "signed_rank_p_from_T": _signed_rank,
}
"""Public call of every kind of published item."""


def follow(where: str, entry: Mapping[str, Any], file: Mapping[str, Any]) -> Outcome:
    """Check what follows from the statistics of an entry whose data set is not in the file.

    F from sums of squares, p and eta from F, t from estimate and error, adjusted p from t. Sums of
    squares, estimates, errors and df themselves are counted as `without_data`.
    """
    expected = entry["expected"]
    got: dict[str, Any] = {}
    if "F" in expected:
        if "ss" in expected:
            got["F"] = [
                s / a / (e / b)
                for s, a, e, b in zip(
                    expected["ss"],
                    expected["df1"],
                    expected["ss_error"],
                    expected["df2"],
                    strict=True,
                )
            ]
        tests = [
            published.check_f(repr(F), a, b).values
            for F, a, b in zip(expected["F"], expected["df1"], expected["df2"], strict=True)
        ]
        got["p"] = [t["p"] for t in tests]
        for name in ("pes", "pes_from_F"):
            got[name] = [t["eta2p"] for t in tests]
    elif "t" in expected:
        t = np.array(expected["t"])
        pairs = list(zip(t.tolist(), expected["df"], strict=True))
        p = [published.check_t(repr(v), df).values["p"] for v, df in pairs]
        got["t"] = (np.array(expected["estimate"]) / np.array(expected["se"])).tolist()
        got["p_none"] = p
        got["p_holm"] = adjust_p(p, "holm").tolist()
        got["p_bonferroni"] = adjust_p(p, "bonferroni").tolist()
        k = round((1 + np.sqrt(1 + 8 * t.size)) / 2)
        got["p_tukey"] = [
            float(studentized_range_sf(abs(v) * np.sqrt(2), k, df)) for v, df in pairs
        ]
    elif "gg_eps" in expected:
        entries = [r for r in file["results"] if r["procedure"] == "art_anova_strata"]
        strata = entries[0]["expected"]
        got["p_gg"] = []
        for term, eps in zip(expected["term"], expected["gg_eps"], strict=True):
            i = strata["term"].index(term)
            df1, df2 = strata["df1"][i] * eps, strata["df2"][i] * eps
            got["p_gg"].append(published.check_f(repr(strata["F"][i]), df1, df2).values["p"])
    known = {k: v for k, v in expected.items() if k in got}
    rest = sum(len(v) if isinstance(v, list) else 1 for k, v in expected.items() if k not in got)
    outcome = compare(where, known, got, entry["tolerance"])
    return Outcome(outcome.compared, outcome.failures, rest)
