"""Map entries of factorial designs (ART, repeated measures, between) to public calls."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from tests.reference.stats_compare import both_ways, by_key, term_key, turned
from visavis.analysis import statistics
from visavis.analysis.statistics.bayes import jzs_bayes_factor
from visavis.analysis.statistics.clmm import clmm
from visavis.analysis.statistics.gee import gee
from visavis.analysis.statistics.lmm import LinearMixed, linear_mixed
from visavis.analysis.statistics_report import Question, answer

Entry = Mapping[str, Any]
MISSING = {"none": "error", "rows": "mixed", "subjects": "listwise"}


class Case:
    """One file with data: frame, design and the entry at hand."""

    def __init__(self, file: Mapping[str, Any], frame: Any = None) -> None:
        self.file = file
        data = file.get("data") or {}
        self.frame = frame if frame is not None else data.get("columns", {})
        self.design = file.get("design") or {}
        self.levels = data.get("levels") or None
        self.sets = {s["name"]: s for s in file.get("sets", [])}

    @property
    def factors(self) -> list[str]:
        """Between factors, then within factors."""
        return [*self.design.get("between", []), *self.design.get("within", [])]

    def arguments(self, entry: Entry) -> dict[str, Any]:
        """Return what every factorial test is called with."""
        return {
            "subject": self.design.get("subject"),
            "within": tuple(self.design.get("within", ())),
            "between": tuple(self.design.get("between", ())),
            "levels": self.levels,
            "missing": MISSING[entry.get("drop", "none")],
        }


def art(case: Case, entry: Entry, **options: Any) -> statistics.ArtAnova:
    """Run the ART ANOVA of an entry; where it takes a mixed model, ARTool's random intercept."""
    arguments = {"random": "intercept", **case.arguments(entry), **options}
    return statistics.art_anova(case.frame, entry["dv"], **arguments)


def _art_columns(case: Case, entry: Entry) -> dict[str, Any]:
    table = art(case, entry)
    assert table.aligned is not None
    assert table.ranks is not None
    assert table.check is not None
    expected = entry["expected"]
    ours = {term_key(t): t for t in table.aligned}
    names = {t: ours.get(term_key(t), "") for t in expected["aligned"]}
    return {
        "rows_kept": len(table.design.rows),
        "row_index": table.design.rows.tolist(),
        "aligned": {t: table.aligned[o].tolist() for t, o in names.items() if o},
        "aligned_ranks": {t: table.ranks[o].tolist() for t, o in names.items() if o},
        "aligned_column_sums": {t: table.check.column_sums[o] for t, o in names.items() if o},
        "max_F_on_aligned_not_of_interest": table.check.largest_other_f,
    }


def _effect(effect: statistics.AnovaEffect) -> dict[str, Any]:
    s = effect.sphericity
    return {
        "df1": effect.df1,
        "df2": effect.df2,
        "ss": effect.ss,
        "ss_error": effect.ss_error,
        "F": effect.F,
        "p": effect.p,
        "pes": effect.eta.value,
        "pes_from_F": effect.eta.value,
        "ges": effect.ges,
        "stratum": effect.error_term,
        "singular_fit": "singular" in effect.error_term,
        "mauchly_W": None if s is None else s.W,
        "mauchly_p_R": None if s is None else s.p_r,
        "mauchly_p_textbook": None if s is None else s.p,
        "gg_eps": None if s is None else s.gg,
        "p_gg": None if s is None else s.p_gg,
        "hf_eps": None if s is None else s.hf,
        "p_hf": None if s is None else s.p_hf,
        "df1_gg": None if s is None else effect.df1 * s.gg,
        "df2_gg": None if s is None else effect.df2 * s.gg,
    }


def _stratum(name: str, subject: str) -> str:
    """Write the stratum as the files do, whose subject column is always called Subject."""
    return ":".join(["Subject", *name.split(":")[1:]]) if name.split(":")[0] == subject else name


def _table(case: Case, entry: Entry, table: statistics.Anova) -> dict[str, Any]:
    rows = {}
    for effect in table.effects:
        row = _effect(effect)
        row["stratum"] = _stratum(effect.error_term, table.subject)
        rows[frozenset(effect.term)] = row
    return by_key(entry["expected"], ["term"], rows, key=term_key)


def _art_anova(**options: Any) -> Callable[[Case, Entry], dict[str, Any]]:
    return lambda case, entry: _table(case, entry, art(case, entry, **options))


def _refuses(case: Case, entry: Entry) -> dict[str, Any]:
    """A missing response must raise; the wording is our own."""
    try:
        art(case, entry)
    except statistics.StatisticsError:
        return {"raises_error": True, "message": entry["expected"].get("message")}
    return {"raises_error": False, "message": None}


def contrast_rows(table: statistics.Contrasts) -> dict[Any, Mapping[str, Any]]:
    """Return contrasts by level pair with every adjustment, in either direction."""
    adjusted = {name: table.with_adjustment(name) for name in ("tukey", "holm", "bonferroni")}
    rows = {}
    for i, c in enumerate(table.contrasts):
        rows[c.pairs[0]] = {
            "estimate": c.estimate,
            "mean_diff": c.estimate,
            "diff": c.estimate,
            "se": c.se,
            "df": c.df,
            "t": c.t,
            "p_none": c.p,
            "dz": None if c.effect is None else c.effect.value,
            "ci_low": c.interval.low if c.interval else None,
            "ci_high": c.interval.high if c.interval else None,
            **{f"p_{name}": t.contrasts[i].p_adjusted for name, t in adjusted.items()},
        }
    return both_ways(rows)


def fitted(case: Case, entry: Entry) -> Any:
    """Fit the model whose contrasts an entry holds, with the errors that R's model has."""
    test, arguments = entry["test"], case.arguments(entry)
    if test == "anova":
        del arguments["within"]
        return statistics.between_anova(case.frame, "y", **arguments)
    if test == "rm":
        return statistics.rm_anova(case.frame, "y", **arguments)
    arguments["missing"] = "mixed"
    if test == "lmm":
        return linear_mixed(case.frame, "y", random=entry["random"], **arguments)
    if test == "gee":
        fit = gee(case.frame, "y", family=entry["family"], **arguments)
        return replace(fit, model=_known_errors(fit.model, fit.model.robust))
    rated = clmm(case.frame, "y", **arguments)
    return replace(rated, model=_known_errors(rated.model, rated.model.likelihood))


def _known_errors(model: Any, covariance: Any) -> Any:
    """Return a model with R's errors, and normal statistics: we print robust ones and t."""
    return replace(model, covariance=covariance, df=10**12)


def _marginal_contrasts(case: Case, entry: Entry) -> dict[str, Any]:
    """Return the contrasts of an entry by every adjustment that R gives."""
    fit, asked = fitted(case, entry), {"weights": entry["weights"]}
    if "error" in entry:
        asked["error"] = entry["error"]
    kind, term, expected = entry["procedure"], tuple(entry["term"]), entry["expected"]
    if kind == "contrasts_simple":
        families = statistics.simple_effects(fit, term, tuple(entry["by"]), **asked)
        rows = {}
        for family in families:
            at = ",".join(
                p.split(" = ")[1] for p in family.provenance.test.split(" at ")[1].split(", ")
            )
            rows |= {(*pair, at): row for pair, row in _pair_rows(family, term).items()}
        return by_key(expected, ["level_1", "level_2", "at"], _without_df(rows, expected))
    if kind == "contrasts_interaction":
        table = statistics.interaction_contrasts(fit, term, adjust="holm", **asked)
        columns = [f"contrast_{i + 1}" for i in range(len(term))]
        return by_key(expected, columns, _without_df(_double_rows(table, term), expected))
    if kind == "contrasts_hypotheses":
        table = statistics.linear_hypotheses(fit, term, entry["hypotheses"], **asked)
        rows = {(c.name,): {**_numbers(c), "p_holm": c.p_adjusted} for c in table.contrasts}
        return by_key(expected, ["name"], _without_df(rows, expected))
    table = statistics.posthoc(fit, term, **asked)
    return by_key(expected, ["level_1", "level_2"], _without_df(_pair_rows(table, term), expected))


def _pair_rows(table: statistics.Contrasts, term: Sequence[str]) -> dict[Any, Mapping[str, Any]]:
    return _reordered(contrast_rows(table), table.term, term)


def _without_df(rows: Mapping[Any, Any], expected: Mapping[str, Any]) -> dict[Any, Any]:
    """Leave out df where R takes the statistic for normal."""
    if any(df is None for df in expected["df"]):
        return {key: {**row, "df": None} for key, row in rows.items()}
    return dict(rows)


def _numbers(c: statistics.Contrast) -> dict[str, Any]:
    return {"estimate": c.estimate, "se": c.se, "df": c.df, "t": c.t, "p_none": c.p}


def _contrasts_of_ranks(case: Case, entry: Entry) -> dict[str, Any]:
    table = statistics.art_contrasts(art(case, entry), entry["term"])
    rows = _pair_rows(table, entry["term"])
    return by_key(entry["expected"], ["level_1", "level_2"], rows)


def _contrasts(error: str) -> Callable[[Case, Entry], dict[str, Any]]:
    def run(case: Case, entry: Entry) -> dict[str, Any]:
        table = statistics.art_contrasts(
            art(case, entry), entry["term"].split(":"), error=error, adjust="tukey"
        )
        rows = contrast_rows(table)
        if table.term != tuple(entry["term"].split(":")):
            rows = _reordered(rows, table.term, entry["term"].split(":"))
        return by_key(entry["expected"], ["level_1", "level_2"], rows)

    return run


def _reordered(
    rows: Mapping[Any, Mapping[str, Any]], ours: Sequence[str], wanted: Sequence[str]
) -> dict[Any, Mapping[str, Any]]:
    """Rename joined levels where the file lists the factors in another order."""

    def rename(label: str) -> str:
        parts = dict(zip(ours, label.split(","), strict=True))
        return ",".join(parts[name] for name in wanted)

    return {(rename(a), rename(b)): row for (a, b), row in rows.items()}


def _double_differences(error: str) -> Callable[[Case, Entry], dict[str, Any]]:
    def run(case: Case, entry: Entry) -> dict[str, Any]:
        table = statistics.art_interaction_contrasts(
            art(case, entry), entry["term"].split(":"), error=error, adjust="none"
        )
        wanted = entry["term"].split(":")
        rows = _double_rows(table, wanted)
        columns = [f"contrast_{i + 1}" for i in range(len(wanted))]
        return by_key(entry["expected"], columns, rows)

    return run


def _double_rows(table: statistics.Contrasts, wanted: Sequence[str]) -> dict[Any, Any]:
    """Return double differences by their pairs in the wanted order, turned in every direction."""
    holm, bonferroni = table.with_adjustment("holm"), table.with_adjustment("bonferroni")
    rows: dict[Any, Mapping[str, Any]] = {}
    for i, c in enumerate(table.contrasts):
        row = {
            **_numbers(c),
            "p_holm": holm.contrasts[i].p_adjusted,
            "p_bonferroni": bonferroni.contrasts[i].p_adjusted,
        }
        pairs = [dict(zip(table.term, c.pairs, strict=True))[name] for name in wanted]
        for flips in product((False, True), repeat=len(pairs)):
            labels = tuple(
                f"{b} - {a}" if flip else f"{a} - {b}"
                for (a, b), flip in zip(pairs, flips, strict=True)
            )
            rows[labels] = turned(row) if sum(flips) % 2 else row
    return rows


def _rm_table(case: Case, entry: Entry) -> statistics.Anova:
    return statistics.rm_anova(case.frame, entry["dv"], **case.arguments(entry))


def _rm_anova(case: Case, entry: Entry) -> dict[str, Any]:
    return _table(case, entry, _rm_table(case, entry))


def _between(ss_type: int) -> Callable[[Case, Entry], dict[str, Any]]:
    def run(case: Case, entry: Entry) -> dict[str, Any]:
        table = statistics.between_anova(
            case.frame,
            entry["dv"],
            between=case.design["between"],
            subject=case.design.get("subject"),
            levels=case.levels,
            ss_type=ss_type,
        )
        return _table(case, entry, table)

    return run


def _lmer_anova(case: Case, entry: Entry) -> dict[str, Any]:
    arguments = case.arguments(entry)
    del arguments["missing"]
    rows: dict[Any, dict[str, Any]] = {}
    for ddf, suffix in (("kenward-roger", "kr"), ("satterthwaite", "satt")):
        for e in statistics.mixed_anova(
            case.frame, entry["dv"], ddf=ddf, random="intercept", **arguments
        ).effects:
            row = rows.setdefault(frozenset(e.term), {"df1": e.df1})
            row |= {f"F_{suffix}": e.F, f"df2_{suffix}": e.df2, f"p_{suffix}": e.p}
    return by_key(entry["expected"], ["term"], rows, key=term_key)


def _linear_mixed(case: Case, entry: Entry) -> LinearMixed:
    arguments = case.arguments(entry) | {"missing": "mixed"}
    fit = linear_mixed(case.frame, entry["dv"], random=entry["random"], **arguments)
    assert fit.random == entry["random"], fit.steps
    return fit


def _lmm(case: Case, entry: Entry) -> dict[str, Any]:
    table = _linear_mixed(case, entry)
    assert table.model is not None
    rows = {frozenset(e.term): _effect(e) for e in table.effects}
    expected = entry["expected"]
    tests = {k: v for k, v in expected.items() if isinstance(v, list)}
    return {
        **by_key(tests, ["term"], rows, key=term_key),
        "reml": table.model.log_likelihood,
        "residual": table.model.parameters["residual"],
    }


def _lmm_contrasts(case: Case, entry: Entry) -> dict[str, Any]:
    table = _linear_mixed(case, entry).contrasts(entry["factor"])
    return by_key(entry["expected"], ["level_1", "level_2"], contrast_rows(table))


def _gee(case: Case, entry: Entry) -> dict[str, Any]:
    arguments = case.arguments(entry) | {"missing": "mixed"}
    model = gee(case.frame, entry["dv"], family=entry["family"], **arguments).model
    return {
        "coefficients": model.beta.tolist(),
        "alpha": model.correlation,
        "se_robust": np.sqrt(np.diag(model.robust)).tolist(),
        "se_corrected": np.sqrt(np.diag(model.covariance)).tolist(),
    }


def _clmm(case: Case, entry: Entry) -> dict[str, Any]:
    random = entry.get("random", "intercept")
    arguments = case.arguments(entry) | {"missing": "mixed", "random": random}
    fit = clmm(case.frame, entry["dv"], **arguments)
    return {
        "thresholds": fit.fit.thresholds.tolist(),
        "coefficients": fit.fit.beta.tolist(),
        "se": np.sqrt(np.diag(fit.fit.covariance)).tolist(),
        "log_likelihood": fit.fit.log_likelihood,
        "sigma": fit.fit.sigma,
        "spread": fit.fit.spread.tolist(),
        "chi2": [e.chi2 for e in fit.effects],
        "chi2_p": [e.chi2_p for e in fit.effects],
    }


def _answer(case: Case, entry: Entry) -> dict[str, Any]:
    """Ask the question of an entry as an analyst would; give back what is compared."""
    asked = {k: tuple(v) if isinstance(v, list) else v for k, v in entry["question"].items()}
    outcome = answer(pd.DataFrame(case.frame), Question(**asked))
    columns = entry["expected"].get("contrasts", ())
    return {
        "title": outcome.title,
        "row": outcome.rows[0],
        "contrasts": {name: [c[name] for c in outcome.contrasts] for name in columns},
    }


def _bayes(case: Case, entry: Entry) -> dict[str, Any]:
    sizes = (entry["n_1"], entry["n_2"] or None)
    return {
        "bf10": jzs_bayes_factor(entry["t"], *sizes),
        "bf10_wide": jzs_bayes_factor(entry["t"], *sizes, scale=1.0),
    }


def _posthoc(error: str) -> Callable[[Case, Entry], dict[str, Any]]:
    def run(case: Case, entry: Entry) -> dict[str, Any]:
        factor = entry.get("factor") or case.design["within"][0]
        table = statistics.posthoc(_rm_table(case, entry), factor, error=error, adjust="tukey")
        return by_key(entry["expected"], ["level_1", "level_2"], contrast_rows(table))

    return run


def _describe(case: Case, entry: Entry) -> dict[str, Any]:
    factors = [f for f in case.factors if f in entry["expected"]]
    cells = statistics.describe(case.frame, entry["dv"], factors=factors, levels=case.levels)
    rows = {tuple(c.labels.values()): c.row() for c in cells}
    return by_key(entry["expected"], factors, rows)


FACTORIAL: Mapping[str, Callable[[Case, Entry], dict[str, Any]]] = {
    "describe": _describe,
    "art_columns": _art_columns,
    "art_missing_response": _refuses,
    "art_anova_lm": _art_anova(error="strata"),
    "art_anova_strata": _art_anova(error="strata"),
    "art_anova_pooled": _art_anova(error="pooled"),
    "art_anova_lmer_kr": _art_anova(error="mixed"),
    "art_anova_lmer_satterthwaite": _art_anova(error="mixed", ddf="satterthwaite"),
    "art_ranks_sphericity": _art_anova(error="strata"),
    "art_con_lm": _contrasts("strata"),
    "art_con_strata": _contrasts("strata"),
    "art_con_pooled": _contrasts("pooled"),
    "art_con_lmer_kr": _contrasts("mixed"),
    "art_con_interaction_lm": _double_differences("strata"),
    "art_con_interaction_lmer_kr": _double_differences("mixed"),
    "rm_anova": _rm_anova,
    "between_anova_type2": _between(2),
    "between_anova_type3": _between(3),
    "lmer_anova": _lmer_anova,
    "lmm": _lmm,
    "lmm_contrasts": _lmm_contrasts,
    "gee": _gee,
    "clmm": _clmm,
    "answer": _answer,
    "jzs_bayes_factor": _bayes,
    "contrasts_pairs": _marginal_contrasts,
    "contrasts_simple": _marginal_contrasts,
    "contrasts_interaction": _marginal_contrasts,
    "contrasts_hypotheses": _marginal_contrasts,
    "contrasts_art": _contrasts_of_ranks,
    "posthoc_paired_t": _posthoc("per_pair"),
    "posthoc_tukey_multivariate": _posthoc("per_pair"),
    "posthoc_tukey_univariate": _posthoc("pooled"),
}
"""Public call of every procedure on a factorial design."""
