"""Map entries of the simple tests to public calls."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from tests.reference.stats_compare import by_key
from tests.reference.stats_factorial import Case, Entry, contrast_rows
from visavis.analysis import statistics
from visavis.analysis.statistics.agreement import cohen_kappa, icc, krippendorff_alpha
from visavis.analysis.statistics.binomial import Binomial, binomial_test, sign_test
from visavis.analysis.statistics.bradley_terry import bradley_terry


def _within(case: Case) -> dict[str, Any]:
    name = case.design["within"][0]
    order = (case.levels or {}).get(name)
    return {"subject": case.design["subject"], "within": name, "levels": order}


def _oneway(case: Case) -> dict[str, Any]:
    name = case.design["between"][0]
    return {"factor": name, "levels": (case.levels or {}).get(name)}


def _friedman(case: Case, entry: Entry) -> dict[str, Any]:
    result = statistics.friedman(case.frame, entry["dv"], **_within(case))
    return {
        "chi2": result.chi2,
        "df": result.df,
        "p": result.p,
        "kendall_W": result.kendall_w,
        "n": result.provenance.n,
        "k": len(result.levels),
        "condition": list(result.levels),
        "mean_rank": list(result.mean_ranks),
        "iman_davenport_F": result.F,
        "iman_davenport_p": result.p_f,
    }


def signed_rank_values(x: Any, y: Any) -> dict[str, Any]:
    """Return every variant of the signed-rank test of one pair of columns."""
    test = statistics.wilcoxon_signed_rank
    default, exact = test(x, y, method="r"), test(x, y, method="exact")
    normal = test(x, y, method="normal")
    corrected = test(x, y, method="normal", continuity=True)
    pratt = test(x, y, method="exact", zeros="pratt")
    plain = not default.has_ties and default.n_nonzero == default.n_pairs
    return {
        "n": default.n_pairs,
        "n_nonzero": default.n_nonzero,
        "has_ties": default.has_ties,
        "V": default.V,
        "T_min": default.T,
        "p_default": default.p,
        "p_normal_cc": corrected.p,
        "p_normal": normal.p,
        "p_exact": exact.p if plain else None,
        "z_wilcoxon": normal.z,
        "p_asym_wilcoxon": normal.p,
        "p_exact_wilcoxon": exact.p,
        "z_pratt": pratt.z,
        "p_asym_pratt": test(x, y, method="normal", zeros="pratt").p,
        "p_exact_pratt": pratt.p,
        "r_z_over_sqrt_n_pairs": normal.r_pairs,
        "r_z_over_sqrt_n_nonzero": normal.r_nonzero,
        "rank_biserial": normal.effect.value,
        "effectsize_rank_biserial": normal.effect.value,
    }


def _wilcoxon(case: Case, entry: Entry) -> dict[str, Any]:
    pair = case.sets[entry["set"]]
    return signed_rank_values(pair["x"], pair["y"])


def _wilcoxon_posthoc(case: Case, entry: Entry) -> dict[str, Any]:
    rows: dict[Any, dict[str, Any]] = {}
    variants: dict[str, dict[str, Any]] = {
        "p_default": {"method": "r"},
        "p_normal": {"method": "normal"},
        "p_normal_cc": {"method": "normal", "continuity": True},
        "p_exact_wilcoxon": {"method": "exact"},
        "p_exact_pratt": {"method": "exact", "zeros": "pratt"},
    }
    name = case.design["within"][0]
    columns = {level: _ordered(case, entry["dv"], name, level) for level in set(case.frame[name])}
    for label, options in variants.items():
        for adjust in ("bonferroni", "holm", "bh"):
            family = statistics.posthoc_signed_rank(
                case.frame, entry["dv"], adjust=adjust, **options, **_within(case)
            )
            for pair in family:
                key = (pair.level_1, pair.level_2)
                if key not in rows:
                    rows[key] = signed_rank_values(*(columns[level] for level in key))
                rows[key][label] = pair.test.p
                rows[key][f"{label}_{adjust}"] = pair.p_adjusted
    return by_key(entry["expected"], ["level_1", "level_2"], rows)


def _ordered(case: Case, dv: str, name: str, level: str) -> list[float]:
    """Return one condition's values in the order of the subjects."""
    rows = zip(case.frame[case.design["subject"]], case.frame[name], case.frame[dv], strict=True)
    return [value for _, _, value in sorted((s, c, v) for s, c, v in rows if c == level)]


def _paired_t(case: Case, entry: Entry) -> dict[str, Any]:
    pair = case.sets[entry["set"]]
    result = statistics.paired_t(pair["x"], pair["y"])
    normality = statistics.compare_paired(pair["x"], pair["y"]).normality
    return {
        "t": result.t,
        "df": result.df,
        "p": result.p,
        "mean_diff": result.estimate,
        "sd_diff": result.sd,
        "ci_low": result.interval.low,
        "ci_high": result.interval.high,
        "dz": result.effect.value,
        "d_av": result.d_av,
        "pes": result.eta.value,
        "shapiro_W_diff": normality.W,
        "shapiro_p_diff": normality.p,
    }


def _one_sample_t(case: Case, entry: Entry) -> dict[str, Any]:
    mu = entry["expected"].get("mu", 0)
    column = case.sets[entry["set"]][_column_of(entry)]
    result = statistics.one_sample_t(column, mu=mu, for_skew=False)
    return {
        "mu": mu,
        "mean": result.means[0],
        "t": result.t,
        "df": result.df,
        "p": result.p,
        "ci_low": result.interval.low + mu,
        "ci_high": result.interval.high + mu,
        "d": result.effect.value,
    }


def _column_of(entry: Entry) -> str:
    """Return which column of a set a one-sample call names: t.test(x, …) or t.test(y, …)."""
    return "y" if "(y" in entry["call"].replace(" ", "") else "x"


def _two_sample(case: Case, entry: Entry) -> dict[str, Any]:
    pair = case.sets[entry["set"]]
    x, y = pair["x"], pair["y"]
    student = statistics.independent_t(x, y)
    welch = statistics.independent_t(x, y, equal_variances=False)
    normal = statistics.mann_whitney(x, y, method="normal")
    corrected = statistics.mann_whitney(x, y, method="normal", continuity=True)
    exact = None if normal.has_ties else statistics.mann_whitney(x, y, method="exact").p
    return {
        "mean_x": student.means[0],
        "mean_y": student.means[1],
        "sd_x": student.sds[0],
        "sd_y": student.sds[1],
        "t": student.t,
        "df": student.df,
        "p": student.p,
        "ci_low": student.interval.low,
        "ci_high": student.interval.high,
        "d_pooled": student.effect.value,
        "eta2": student.eta.value,
        "welch_t": welch.t,
        "welch_df": welch.df,
        "welch_p": welch.p,
        "U": normal.U,
        "mwu_p_normal": normal.p,
        "mwu_p_normal_cc": corrected.p,
        "mwu_p_exact": exact,
    }


def _oneway_anova(case: Case, entry: Entry) -> dict[str, Any]:
    result = statistics.oneway_anova(case.frame, entry["dv"], **_oneway(case))
    return {
        "ss": result.ss,
        "ss_error": result.ss_error,
        "df1": result.df1,
        "df2": result.df2,
        "F": result.F,
        "p": result.p,
        "eta2": None if result.eta is None else result.eta.value,
        "omega2": result.omega2,
        "cohen_f": result.cohen_f,
    }


def _oneway_other(case: Case, entry: Entry) -> dict[str, Any]:
    arguments = _oneway(case)
    ranks = statistics.kruskal_wallis(case.frame, entry["dv"], **arguments)
    welch = statistics.welch_anova(case.frame, entry["dv"], **arguments)
    levene = statistics.levene(case.frame, entry["dv"], **arguments)
    return {
        "kruskal_H": ranks.H,
        "kruskal_p": ranks.p,
        "welch_F": welch.F,
        "welch_df1": welch.df1,
        "welch_df2": welch.df2,
        "welch_p": welch.p,
        "levene_F": levene.F,
        "levene_p": levene.p,
    }


def _lm_means(case: Case, entry: Entry) -> dict[str, Any]:
    arguments = _oneway(case)
    result = statistics.group_means(case.frame, entry["dv"], **arguments)
    return {
        "coef": [
            c if i == 0 else f"{arguments['factor']}{c}" for i, c in enumerate(result.coefficients)
        ],
        "estimate": result.estimate.tolist(),
        "se": result.se.tolist(),
        "t": result.t.tolist(),
        "p": result.p.tolist(),
        "r2": result.r2,
        "level": list(result.levels),
        "mean": result.means.tolist(),
    }


def _tukey(case: Case, entry: Entry) -> dict[str, Any]:
    table = statistics.tukey_hsd(case.frame, entry["dv"], **_oneway(case))
    return by_key(entry["expected"], ["level_1", "level_2"], contrast_rows(table))


def _pairwise_t(case: Case, entry: Entry) -> dict[str, Any]:
    one = _oneway(case)
    levels = one["levels"] and {one["factor"]: one["levels"]}
    table = statistics.posthoc(
        statistics.between_anova(case.frame, entry["dv"], between=(one["factor"],), levels=levels),
        one["factor"],
    )
    return by_key(entry["expected"], ["level_1", "level_2"], contrast_rows(table))


def _shapiro(case: Case, entry: Entry) -> dict[str, Any]:
    result = statistics.shapiro_wilk(case.sets[entry["set"]]["x"])
    return {"n": result.n, "W": result.W, "p": result.p}


def _shapiro_by(case: Case, entry: Entry) -> dict[str, Any]:
    name = (case.design["within"] or case.design["between"])[0]
    labels, values = np.asarray(case.frame[name]), np.asarray(case.frame[entry["dv"]])
    rows = {}
    for level in set(labels.tolist()):
        result = statistics.shapiro_wilk(values[labels == level])
        rows[(level,)] = {"W": result.W, "p": result.p}
    return by_key(entry["expected"], ["level"], rows)


def _p_adjust(case: Case, entry: Entry) -> dict[str, Any]:
    p = case.sets[entry["set"]]["x"]
    return {
        name: statistics.adjust_p(p, name.lower()).tolist()
        for name in entry["expected"]
        if name.lower() in ("none", "bonferroni", "holm", "bh")
    }


def _spearman(case: Case, entry: Entry) -> dict[str, Any]:
    pair = case.sets[entry["set"]]
    plain = statistics.spearman(pair["x"], pair["y"], method="t")
    exact = None
    if not plain.has_ties:
        method = "exact" if plain.n <= 9 else "edgeworth"
        exact = statistics.spearman(pair["x"], pair["y"], method=method).p
    linear = statistics.pearson(pair["x"], pair["y"])
    return {
        "n": plain.n,
        "rho": plain.r,
        "p_t": plain.p,
        "has_ties": plain.has_ties,
        "p_R_exact": exact,
        "pearson_r": linear.r,
        "pearson_p": linear.p,
    }


def _cronbach(case: Case, entry: Entry) -> dict[str, Any]:
    items = entry["expected"].get("items") or case.design["items"]
    reverse = entry["expected"].get("reversed") or ()
    if isinstance(reverse, str):
        reverse = (reverse,)
    result = statistics.cronbach_alpha(case.frame, items, reverse=reverse)
    return {
        "raw_alpha": result.alpha,
        "std_alpha": result.standardised,
        "average_r": result.average_r,
        "alpha_if_dropped": list(result.without_item),
        "items": list(result.items),
        "reversed": list(result.reversed_items),
        "raw_alpha_without_reversing": result.unreversed,
    }


def _bradley_terry(case: Case, entry: Entry) -> dict[str, Any]:
    frame = {name: np.asarray(v, dtype=object) for name, v in case.frame.items()}
    if "count" in frame:  # choices of as many people
        frame = {name: np.repeat(v, frame["count"].astype(int)) for name, v in frame.items()}
        frame["s"] = np.arange(frame["y"].size)
    outcome = bradley_terry(
        frame,
        entry["dv"],
        first=case.design["first"],
        second=case.design["second"],
        subject=case.design["subject"],
        items=entry["items"],
        side=entry.get("side", False),
        random=entry.get("random", ""),
    )
    effect, model = outcome.effects[0], outcome.model
    return {
        "coefficients": model.beta.tolist(),
        "se": np.sqrt(np.diag(model.likelihood)).tolist(),
        "robust_se": np.sqrt(np.diag(model.robust)).tolist(),
        "log_likelihood": model.log_likelihood,
        "spread": model.spread.tolist(),
        "test": {"F": effect.F, "df1": effect.df1, "df2": effect.df2, "p": effect.p},
        "chi2": effect.chi2,
        "chi2_p": effect.chi2_p,
        "fit_chi2": None if outcome.fit is None else outcome.fit.chi2,
        "fit_df": None if outcome.fit is None else outcome.fit.df,
    }


def _ratings(case: Case) -> Any:
    return np.array(case.file["ratings"], dtype=float)


def _icc(case: Case, entry: Entry) -> dict[str, Any]:
    outcome = icc(_ratings(case))
    return {
        "kind": [m.kind for m in outcome],
        "value": [m.value for m in outcome],
        "F": [m.F for m in outcome],
        "df1": [m.df1 for m in outcome],
        "df2": [m.df2 for m in outcome],
        "p": [m.p for m in outcome],
        "low": [m.by_f.low for m in outcome],
        "high": [m.by_f.high for m in outcome],
    }


def _kappa(case: Case, entry: Entry) -> dict[str, Any]:
    outcome = cohen_kappa(_ratings(case), scale=entry["scale"])
    return {"value": outcome.value, "se": outcome.se}


def _alpha(case: Case, entry: Entry) -> dict[str, Any]:
    return {"value": krippendorff_alpha(_ratings(case), scale=entry["scale"]).value}


def _counted(outcome: Binomial) -> dict[str, Any]:
    assert outcome.effect.interval is not None
    ends = outcome.effect.interval
    return {
        "hits": outcome.hits,
        "n": outcome.n,
        "p": outcome.p,
        "low": ends.low,
        "high": ends.high,
    }


def _sign(case: Case, entry: Entry) -> dict[str, Any]:
    pair = case.sets[entry["set"]]
    return _counted(sign_test(pair["x"], pair["y"]))


def _binomial(case: Case, entry: Entry) -> dict[str, Any]:
    return _counted(binomial_test(**entry["given"]))


def _power(case: Case, entry: Entry) -> dict[str, Any]:
    given = dict(entry["given"])
    alpha = given.get("alpha", given.get("sig_level", 0.05))
    k, n, f, power = (given.get(name) for name in ("k", "n", "f", "power"))
    if power is None:
        result = statistics.oneway_power(k=k, n_per_group=n, f=f, alpha=alpha)
    elif n is None:
        result = statistics.oneway_sample_size(k=k, f=f, power=power, alpha=alpha)
    else:
        result = statistics.oneway_sensitivity(k=k, n_per_group=n, power=power, alpha=alpha)
    return {
        "k": result.k,
        "n_per_group": result.n_per_group,
        "n_per_group_ceil": result.n_needed,
        "f": result.f,
        "power": result.power,
    }


def _ward(case: Case, entry: Entry) -> dict[str, Any]:
    selection = statistics.select_scales(case.file["ratings"])
    tree = statistics.ward(selection.profiles, entry["k"])
    return {
        "max_abs_mean": selection.max_abs_mean.tolist(),
        "mean_sd": selection.mean_spread.tolist(),
        "kept_index": selection.indices.tolist(),
        "delta_E": tree.increases.tolist(),
        "ward_D2_height": tree.heights.tolist(),
        "cluster": tree.labels.tolist(),
        "cluster_means": tree.means.tolist(),
    }


SIMPLE: Mapping[str, Callable[[Case, Entry], dict[str, Any]]] = {
    "friedman": _friedman,
    "wilcoxon_signed_rank": _wilcoxon,
    "wilcoxon_posthoc": _wilcoxon_posthoc,
    "paired_t": _paired_t,
    "one_sample_t": _one_sample_t,
    "two_sample": _two_sample,
    "oneway_anova": _oneway_anova,
    "oneway_other": _oneway_other,
    "lm_means": _lm_means,
    "tukey_hsd": _tukey,
    "pairwise_t_pooled": _pairwise_t,
    "shapiro_wilk": _shapiro,
    "shapiro_by": _shapiro_by,
    "p_adjust": _p_adjust,
    "spearman": _spearman,
    "cronbach_alpha": _cronbach,
    "power_oneway_anova": _power,
    "ward": _ward,
    "bradley_terry": _bradley_terry,
    "icc": _icc,
    "cohen_kappa": _kappa,
    "krippendorff_alpha": _alpha,
    "sign_test": _sign,
    "binomial_test": _binomial,
}
"""Public call of every simple procedure."""
