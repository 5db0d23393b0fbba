"""R code that repeats a test on the rows it saw, so that a reader can check it without Visavis.

The code reads `tested.csv` beside it and prints one line per statistic: name, value, p, divided by
tabs. Base R is used wherever it has the test; other packages are named at the top.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

from visavis.analysis.statistics_report.outcome import Outcome
from visavis.analysis.statistics_report.r_contrasts import (
    GRID,
    WIDE_MODEL,
    aligned_lines,
    dunn_lines,
    games_howell_lines,
    marginal_lines,
    pair_lines,
)
from visavis.analysis.statistics_report.r_values import r_string, r_vector

DATA_FILE = "tested.csv"
LINE = 'line <- function(name, value, p) cat(sprintf("%s\\t%.10g\\t%.10g\\n", name, value, p))'


def r_code(outcome: Outcome) -> str:
    """Return an R script, or an empty text where the outcome carries no data."""
    data, q = outcome.data, outcome.question
    if data is None or q.test not in _BODIES:
        return ""
    factors = {
        f: [str(v) for v in dict.fromkeys(data[f].cat.categories)]
        for f in (*q.between, *q.within)
        if f in data
    }
    names = {f: f"f{i}" for i, f in enumerate(factors, 1)}
    body, packages = _BODIES[q.test](outcome, names)
    head = [f"# {outcome.title} of {q.dv or 'the items'}, again in R."]
    if packages:
        head.append(f"# Needs the package{'s' if len(packages) > 1 else ''} {', '.join(packages)}.")
    lines = [*head, f'd <- read.csv("{DATA_FILE}", check.names = FALSE)', LINE]
    if any("off(" in line for line in body):
        lines.append(OFF)
    if q.test == "cronbach":
        return "\n".join([*lines, *body]) + "\n"
    lines.append(f"d$y <- d[[{r_string(q.dv)}]]")
    if q.partner:
        lines.append(f"d$x <- d[[{r_string(q.partner)}]]")
    if q.subject and q.subject in data:
        lines.append(f"d$s <- factor(d[[{r_string(q.subject)}]])")
    lines += [
        f"d${names[f]} <- factor(d[[{r_string(f)}]], levels = {r_vector(levels)})"
        for f, levels in factors.items()
    ]
    lines.append('options(contrasts = c("contr.sum", "contr.poly"))  # type III')
    return "\n".join([*lines, *body]) + "\n"


Body = tuple[list[str], tuple[str, ...]]
"""Lines of code, and the packages they need."""


def _r_term(names: Mapping[str, str], term: str) -> str:
    """Return how R prints a term: f1:f2."""
    return ":".join(names[f] for f in term.split(":"))


def _pairs(outcome: Outcome) -> list[tuple[str, str]]:
    """Return the pairs of levels that were compared, in their order."""
    assert outcome.data is not None  # noqa: S101  # r_code asked
    q = outcome.question
    factor = (*q.within, *q.between)[0]
    return list(combinations([str(v) for v in outcome.data[factor].cat.categories], 2))


def _two(
    outcome: Outcome, names: Mapping[str, str], call: str, statistic: str, effect: str = ""
) -> list[str]:
    """Return a call for each pair of levels; x and y are their values, paired by subject."""
    lines = ["d <- d[order(d$s), ]"] if outcome.question.within else []
    for a, b in _pairs(outcome):
        lines += [
            f"x <- d$y[d$f1 == {r_string(a)}]; y <- d$y[d$f1 == {r_string(b)}]",
            f"t <- {call}",
            f"line({r_string(f'{a} - {b}')}, {statistic}, "
            f"{'coin::pvalue(t)' if 'coin::' in call else 't$p.value'})",
        ]
        if effect:
            lines.append(f"line({r_string(f'effect {a} - {b}')}, {effect}, NA)")
    return lines


# Float noise would part equal differences: 0.3 - 0.1 and 0.2 - 0.
OFF = (
    "off <- function(x, y) { unit <- 10^floor(log10(max(abs(c(x, y))))); "
    "round((x - y) / unit, 9) * unit }"
)
POOLED_SD = (
    "sqrt(((length(x) - 1) * var(x) + (length(y) - 1) * var(y)) / (length(x) + length(y) - 2))"
)
MATCHED = "{ r <- off(x, y); r <- r[r != 0]; sum(sign(r) * rank(abs(r))) / sum(rank(abs(r))) }"
SIGNED_RANK = (
    "coin::wilcoxsign_test(off(x, y) ~ rep(0, length(x)), "
    'distribution = "exact", zero.method = "Wilcoxon")',
    "{ r <- off(x, y); r <- r[r != 0]; sum(rank(abs(r))[r > 0]) }",
)


def _t(outcome: Outcome, names: Mapping[str, str]) -> Body:
    q = outcome.question
    if not names:
        return [
            f"t <- t.test(d$y, mu = {q.reference.mu!r})",
            'line("t", t$statistic, t$p.value)',
        ], ()
    how = "paired = TRUE" if q.within else f"var.equal = {str(q.model.equal_variances).upper()}"
    effect = "mean(x - y) / sd(x - y)" if q.within else f"(mean(x) - mean(y)) / {POOLED_SD}"
    return _two(outcome, names, f"t.test(x, y, {how})", "t$statistic", effect), ()


def _wilcoxon(outcome: Outcome, names: Mapping[str, str]) -> Body:
    call, V = SIGNED_RANK
    return _two(outcome, names, call, V, MATCHED), ("coin",)


def _paired_tests(outcome: Outcome, names: Mapping[str, str]) -> Body:
    """Repeat the test that the decision path took for each pair."""
    lines, ranks = ["d <- d[order(d$s), ]"], False
    for (a, b), row in zip(_pairs(outcome), outcome.rows, strict=True):
        by_rank = row.get("V") is not None
        ranks |= by_rank
        call, statistic = SIGNED_RANK if by_rank else ("t.test(x, y, paired = TRUE)", "t$statistic")
        lines += [
            f"x <- d$y[d$f1 == {r_string(a)}]; y <- d$y[d$f1 == {r_string(b)}]",
            f"line({r_string(f'{a} - {b}, Shapiro-Wilk')}, shapiro.test(x - y)$statistic, "
            "shapiro.test(x - y)$p.value)",
            f"t <- {call}",
            f"line({r_string(f'{a} - {b}')}, {statistic}, "
            f"{'coin::pvalue(t)' if by_rank else 't$p.value'})",
        ]
    return lines, ("coin",) if ranks else ()


def _mann_whitney(outcome: Outcome, names: Mapping[str, str]) -> Body:
    lines = []
    for a, b in _pairs(outcome):
        lines += [
            f"e <- droplevels(d[d$f1 %in% {r_vector([a, b])}, ])",
            't <- coin::wilcox_test(y ~ f1, data = e, distribution = "exact")',
            f"U <- suppressWarnings(wilcox.test(e$y[e$f1 == {r_string(a)}], "
            f"e$y[e$f1 == {r_string(b)}])$statistic)",
            f"line({r_string(f'{a} - {b}')}, U, coin::pvalue(t))",
            f"line({r_string(f'effect {a} - {b}')}, 2 * U / prod(table(e$f1)) - 1, NA)",
        ]
    return lines, ("coin",)


def _shapiro(outcome: Outcome, names: Mapping[str, str]) -> Body:
    q = outcome.question
    one = "line({name}, shapiro.test({values})$statistic, shapiro.test({values})$p.value)"
    if not names:
        return [one.format(name=r_string(q.dv), values="d$y")], ()
    assert outcome.data is not None  # noqa: S101  # r_code asked
    factor = (*q.within, *q.between)[0]
    levels = [str(v) for v in outcome.data[factor].cat.categories]
    lines = ["d <- d[order(d$s), ]"] if q.within else []
    values = {v: f"d$y[d$f1 == {r_string(v)}]" for v in levels}
    lines += [one.format(name=r_string(f"{factor} {v}"), values=values[v]) for v in levels]
    if q.within:
        lines += [
            one.format(name=r_string(f"{a} - {b}"), values=f"{values[a]} - {values[b]}")
            for a, b in combinations(levels, 2)
        ]
    return lines, ()


def _correlation(outcome: Outcome, names: Mapping[str, str]) -> Body:
    exact = "" if outcome.question.test == "pearson" else ", exact = nrow(d) <= 9"
    call = f'cor.test(d$x, d$y, method = "{outcome.question.test}"{exact})'
    return [f"t <- {call}", 'line("correlation", t$estimate, t$p.value)'], ()


def _tost(outcome: Outcome, names: Mapping[str, str]) -> Body:
    q = outcome.question
    values, how = "d$y", ""
    lines = []
    spread = "sd(d$y)"
    if names:
        ((a, b),) = _pairs(outcome)
        lines = ["d <- d[order(d$s), ]"] if q.within else []
        lines.append(f"x <- d$y[d$f1 == {r_string(a)}]; y <- d$y[d$f1 == {r_string(b)}]")
        groups = f", var.equal = {str(q.model.equal_variances).upper()}"
        values, how = "x, y", ", paired = TRUE" if q.within else groups
        spread = "sd(x - y)" if q.within else POOLED_SD
    lines.append(f"unit <- {'1' if q.reference.unit == 'raw' else spread}")
    for name, bound, side in (
        ("above low", q.reference.low, "greater"),
        ("below high", q.reference.high, "less"),
    ):
        call = f't.test({values}{how}, mu = {bound!r} * unit, alternative = "{side}")'
        lines.append(f'{{ t <- {call}; line("{name}", t$statistic, t$p.value) }}')
    return lines, ()


def _cronbach(outcome: Outcome, names: Mapping[str, str]) -> Body:
    items = ", ".join(
        f"{'-' if i in outcome.question.reliability.reverse else ''}d[[{r_string(i)}]]"
        for i in outcome.question.reliability.items
    )
    return [
        f"items <- cbind({items}); k <- ncol(items)",
        'line("alpha", k / (k - 1) * (1 - sum(apply(items, 2, var)) / var(rowSums(items))), NA)',
    ], ()


AOV = """afex_table <- function(data, within, between) {
  e <- suppressWarnings(suppressMessages(afex::aov_ez("s", "y", data, within = within, between = between, type = 3)))
  summary(e$Anova, multivariate = FALSE)
}
plain <- function(e) e$univariate.tests[-1, , drop = FALSE]"""  # noqa: E501  # one line of R


def _roles(outcome: Outcome, names: Mapping[str, str]) -> str:
    def roles(factors: Sequence[str]) -> str:
        return r_vector([names[f] for f in factors]) if factors else "NULL"

    q = outcome.question
    return f"{roles(q.within)}, {roles(q.between)}"


def _f_lines(source: str, outcome: Outcome, names: Mapping[str, str]) -> list[str]:
    """Return lines that print F and p of each effect, corrected for sphericity as it was."""
    lines = []
    for row in outcome.rows:
        term, correction = str(row["term"]), row.get("sphericity_correction")
        at = r_string(_r_term(names, term))
        p = f'plain({source})[{at}, "Pr(>F)"]'
        if correction == "Greenhouse-Geisser":
            p = f'{source}$pval.adjustments[{at}, "Pr(>F[GG])"]'
        elif correction == "Huynh-Feldt":
            p = f'{source}$pval.adjustments[{at}, "Pr(>F[HF])"]'
        lines.append(f'line({r_string(term)}, plain({source})[{at}, "F value"], {p})')
        if row.get("effect") == "η²p":
            lines += [
                f"u <- plain({source})[{at}, ]",
                f"line({r_string(f'effect {term}')}, "
                'u["Sum Sq"] / (u["Sum Sq"] + u["Error SS"]), NA)',
            ]
    return lines


def _ancova(outcome: Outcome, names: Mapping[str, str]) -> Body:
    """Return code of tests with covariates, centred over people; contrasts are left out."""
    q = outcome.question
    covariate_names = {name: f"c{j}" for j, name in enumerate(q.model.covariates, 1)}
    lines = ["per <- d[!duplicated(d$s), ]"] if "s" in _columns(outcome) else ["per <- d"]
    lines += [
        f"d${short} <- d[[{r_string(name)}]] - mean(per[[{r_string(name)}]])"
        for name, short in covariate_names.items()
    ]
    packages: tuple[str, ...] = ("car",)
    if q.within:
        packages = ("afex",)
        roles = ", ".join(
            f"{role} = {r_vector([names[f] for f in factors])}"
            for role, factors in (("within", q.within), ("between", q.between))
            if factors
        )
        lines.append(
            "held <- function(how) suppressWarnings(suppressMessages(afex::aov_ez("
            f'"s", "y", d, {roles}, covariate = {r_vector(list(covariate_names.values()))}, '
            "factorize = FALSE, anova_table = list(correction = how))))$anova_table"
        )
    else:
        formula = f"{' * '.join(names.values())} + {' + '.join(covariate_names.values())}"
        lines.append(f"held <- function(how) car::Anova(lm(y ~ {formula}, d), type = 3)")
    ways, at = {"Greenhouse-Geisser": "GG", "Huynh-Feldt": "HF"}, ""
    for row in outcome.rows:
        term = ":".join({**names, **covariate_names}[name] for name in str(row["term"]).split(":"))
        way = ways.get(str(row["sphericity_correction"]), "none")
        if way != at:
            lines.append(f"e <- held({r_string(way)})")
            at = way
        value = f'e[{r_string(term)}, grep("^F", names(e))], e[{r_string(term)}, "Pr(>F)"]'
        lines.append(f"line({r_string(str(row['term']))}, {value})")
    lines.append("# Contrasts hold the covariates at their means (0 here): emmeans(model, term).")
    return lines, packages


def _columns(outcome: Outcome) -> tuple[str, ...]:
    """Return the short names of columns that the script has made."""
    data, q = outcome.data, outcome.question
    return ("s",) if data is not None and q.subject in data else ()


def _rm(outcome: Outcome, names: Mapping[str, str]) -> Body:
    if outcome.question.model.covariates:
        return _ancova(outcome, names)
    table_line = f"e <- afex_table(d, {_roles(outcome, names)})"
    contrasts = marginal_lines(outcome, names, _wide(outcome, names))
    packages = ("afex", "emmeans") if contrasts else ("afex",)
    return [AOV, table_line, *_f_lines("e", outcome, names), *contrasts], packages


def _wide(outcome: Outcome, names: Mapping[str, str]) -> list[str]:
    """Return code of the multivariate linear model of people's cells."""
    q = outcome.question
    factors = [
        f"{role} <- {r_vector([names[f] for f in of_role])}"
        for role, of_role in (("within", q.within), ("between", q.between))
    ]
    return [*factors, WIDE_MODEL]


def _lm(outcome: Outcome, names: Mapping[str, str]) -> list[str]:
    lines = [f"t <- drop1(aov(y ~ {' * '.join(names.values())}, data = d), . ~ ., test = 'F')"]
    for row in outcome.rows:
        at = r_string(_r_term(names, str(row["term"])))
        lines.append(f'line({r_string(str(row["term"]))}, t[{at}, "F value"], t[{at}, "Pr(>F)"])')
        if row.get("effect") == "η²p":
            term = r_string(f"effect {row['term']}")
            share = f't[{at}, "Sum of Sq"] / (t[{at}, "Sum of Sq"] + t["<none>", "RSS"])'
            lines.append(f"line({term}, {share}, NA)")
    return lines


def _anova(outcome: Outcome, names: Mapping[str, str]) -> Body:
    if outcome.question.model.covariates:
        return _ancova(outcome, names)
    model = [f"m <- lm(y ~ {' * '.join(names.values())}, data = d)", GRID]
    contrasts = marginal_lines(outcome, names, model)
    return [*_lm(outcome, names), *contrasts], ("emmeans",) if contrasts else ()


ALIGNED = """aligned_ranks <- function(term, factors) {
  mean_in <- function(u) if (length(u)) ave(d$y, interaction(d[u])) else rep(mean(d$y), nrow(d))
  effect <- 0
  for (size in 0:length(term)) for (u in combn(term, size, simplify = FALSE))
    effect <- effect + (-1)^(length(term) - size) * mean_in(u)
  unit <- 10^floor(log10(max(abs(d$y - mean(d$y)))))
  rank(round((d$y - mean_in(factors) + effect) / unit, 8))
}"""


def _art(outcome: Outcome, names: Mapping[str, str]) -> Body:
    q = outcome.question
    if q.model.error != "strata" or q.missing == "mixed":
        return _mixed_note(outcome, names)
    lines = [AOV] if q.within else []
    every = r_vector(list(names.values()))
    if q.model.transform == "int":
        lines.append("d$y <- qnorm((rank(d$y) - 3/8) / (nrow(d) + 1/4))")
    else:
        lines.append(ALIGNED)
        lines.append("response <- d$y")
    for row in outcome.rows:
        alone = _with_rows(outcome, [row])
        if q.model.transform == "art":
            term = r_vector([names[f] for f in str(row["term"]).split(":")])
            lines += ["d$y <- response", f"d$y <- aligned_ranks({term}, {every})"]
        if q.within:
            lines.append(f"e <- afex_table(d, {_roles(outcome, names)})")
            lines += _f_lines("e", alone, names)
        else:
            lines += _lm(alone, names)
    if q.model.transform == "art":
        contrasts = aligned_lines(outcome, names)
    else:
        model = [f"m <- lm(y ~ {' * '.join(names.values())}, data = d)", GRID]
        contrasts = marginal_lines(outcome, names, _wide(outcome, names) if q.within else model)
    packages = ("afex",) if q.within else ()
    return [*lines, *contrasts], (*packages, "emmeans") if len(contrasts) > 1 else packages


def _with_rows(outcome: Outcome, rows: Sequence[Mapping[str, object]]) -> Outcome:
    return replace(outcome, rows=tuple(rows))  # type: ignore[arg-type]  # rows of this outcome


def _slopes(outcome: Outcome, names: Mapping[str, str], *, all_terms: bool) -> str:
    """Return one variance per subject and within effect, but for the residual's."""
    within = [names[f] for f in outcome.question.within]
    sizes = range(1, len(within) + (1 if all_terms else 0))
    terms = [":".join(t) for size in sizes for t in combinations(within, size)]
    return " + ".join(["(1 | s)", *(f"(1 | s:{t})" for t in terms)])


def _kenward_roger(outcome: Outcome, names: Mapping[str, str], random: str) -> Body:
    fixed_part = " * ".join(names.values())
    lines = [
        "# lme4 stops a variance at zero where Visavis lets it pass below (its notes say so).",
        f"m <- suppressMessages(lmerTest::lmer(y ~ {fixed_part} + {random}, data = d))",
        't <- anova(m, type = 3, ddf = "Kenward-Roger")',
    ]
    for row in outcome.rows:
        at = r_string(_r_term(names, str(row["term"])))
        lines.append(f'line({r_string(str(row["term"]))}, t[{at}, "F value"], t[{at}, "Pr(>F)"])')
    contrasts = marginal_lines(outcome, names, [GRID])
    packages = ("lmerTest", "pbkrtest")
    return [*lines, *contrasts], (*packages, "emmeans") if contrasts else packages


def _mixed_note(outcome: Outcome, names: Mapping[str, str]) -> Body:
    lines = [f"# Not repeated here: aligned ranks with {outcome.rows[0]['error_term']}."]
    return lines, ()


def _mixed_model(outcome: Outcome, names: Mapping[str, str]) -> Body:
    return _kenward_roger(outcome, names, _slopes(outcome, names, all_terms=False))


def _lmm(outcome: Outcome, names: Mapping[str, str]) -> Body:
    assert outcome.data is not None  # noqa: S101  # r_code asked
    q = outcome.question
    has_repeats = bool(outcome.data.duplicated([q.subject, *q.within]).any())
    if "one variance each" in str(outcome.rows[0]["error_term"]):
        return _kenward_roger(outcome, names, _slopes(outcome, names, all_terms=has_repeats))
    within = [names[f] for f in q.within]
    inner = " * ".join(within)
    if not has_repeats:
        inner = f"({' + '.join(within)})^{len(within) - 1}"
    return _kenward_roger(outcome, names, f"({inner} | s)")


def _gee(outcome: Outcome, names: Mapping[str, str]) -> Body:
    fixed_part = " * ".join(names.values())
    return [
        "d <- d[order(d$s), ]",
        f"m <- geepack::geeglm(y ~ {fixed_part}, id = d$s, data = d, "
        f'family = {outcome.question.model.family}, corstr = "exchangeable")',
        "t <- summary(m)$coefficients",
        "# The same estimates; errors are the plain sandwich, without Mancl and DeRouen's",
        "# correction for few subjects, so p is smaller than Visavis prints.",
        'for (i in rownames(t)) line(i, t[i, "Estimate"], t[i, "Pr(>|W|)"])',
        *(contrasts := marginal_lines(outcome, names, [GRID], show="estimate")),
    ], ("geepack", "emmeans") if contrasts else ("geepack",)


def _clmm(outcome: Outcome, names: Mapping[str, str]) -> Body:
    assert outcome.data is not None  # noqa: S101  # r_code asked
    q = outcome.question
    has_people = bool(q.subject) and bool(outcome.data.duplicated([q.subject]).any())
    random, how = ("(1 | s)", ", nAGQ = 15") if has_people else ("", "")
    lines = [
        f"X <- model.matrix(~ {' * '.join(names.values())}, d)",
        'term <- attr(X, "assign")[-1]; X <- X[, -1, drop = FALSE]',
    ]
    slopes = _people_differ(outcome)
    if slopes:
        parts = [term.split(":") for term in slopes]
        slope_vector = r_vector(
            [":".join(r for f, r in names.items() if f in part) for part in parts]
        )
        labels = f'attr(terms(~ {" * ".join(names.values())}), "term.labels")'
        lines.append(f"own <- X[, {labels}[term] %in% {slope_vector}, drop = FALSE]")
        lines.append("# ordinal integrates several random effects by Laplace's approximation.")
        random, how = "(1 + own | s)", ""
    more = f', "+ {random}"' if has_people else ""
    call = f"clmm(f, data = d[{r_vector(['y', 's'])}]{how})" if has_people else "clm(f, data = d)"
    lines += [
        "fit <- function(keep) {",
        '  columns <- if (any(keep)) "X[, keep, drop = FALSE]" else "1"',
        f'  f <- as.formula(paste("ordered(y) ~", columns{more}))',
        "  environment(f) <- environment()",
        f"  ordinal::{call}",
        "}",
        "full <- fit(rep(TRUE, ncol(X)))",
        "# Likelihood ratios: they take people for alike in the effects that do not vary in the",
        "# model. The F tests that Visavis decides by have errors robust to people who differ,",
        "# which ordinal does not offer.",
    ]
    for i, row in enumerate(outcome.rows, 1):
        ratio = f"2 * c(logLik(full) - logLik(fit(term != {i})))"
        lines.append(
            f"chi2 <- {ratio}; line({r_string(str(row['term']))}, chi2, "
            f"pchisq(chi2, sum(term == {i}), lower.tail = FALSE))"
        )
    formula = " * ".join(names.values())
    people = f" + {random}" if has_people else ""
    model = [
        "d$rating <- ordered(d$y)",
        f"m <- ordinal::clm{'m' * has_people}(rating ~ {formula}{people}, data = d{how})",
        GRID,
    ]
    if slopes:
        return lines, ("ordinal",)  # emmeans does not know columns of the slopes' own
    contrasts = marginal_lines(outcome, names, model, show="estimate")
    return [*lines, *contrasts], ("ordinal", "emmeans") if contrasts else ("ordinal",)


def _people_differ(outcome: Outcome) -> list[str]:
    """Return the terms in which people have slopes of their own in a cumulative link model."""
    assert outcome.data is not None  # noqa: S101  # r_code asked
    q = outcome.question
    if q.model.random in ("", "intercept"):
        return []
    if q.model.random != "maximal":
        return q.model.random.replace(" ", "").split("+")
    has_repeats = bool(outcome.data.duplicated([q.subject, *q.within]).any())
    sizes = range(1, len(q.within) + 1)
    terms = [":".join(t) for size in sizes for t in combinations(q.within, size)]
    return terms if has_repeats else terms[:-1]


def _bradley_terry(outcome: Outcome, names: Mapping[str, str]) -> Body:
    assert outcome.data is not None  # noqa: S101  # r_code asked
    q = outcome.question
    first, second = outcome.data.columns[1:3]
    items = [str(v) for v in outcome.data[first].cat.categories]
    groups = [f"d${names[g]}" for g in q.between]
    lines = [
        f"first <- d[[{r_string(str(first))}]]; second <- d[[{r_string(str(second))}]]",
        f"X <- sapply({r_vector(items[1:])}, function(v) (first == v) - (second == v))",
        "term <- rep(1, ncol(X))",
    ]
    if q.model.side:
        lines.append("X <- cbind(X, 1); term <- c(term, 0)")
    if groups:
        lines.append(f"G <- model.matrix(~ {groups[0]})[, -1, drop = FALSE]; own <- X[, term == 1]")
        lines.append(
            "X <- cbind(X, do.call(cbind, lapply(seq_len(ncol(G)), "
            "function(j) own * G[, j]))); "
            "term <- c(term, rep(2, ncol(own) * ncol(G)))"
        )
    if q.model.random:
        return _people_like(outcome, lines)
    lines += [
        "# Davidson's likelihood (Bradley and Terry's where there are no ties), by optim.",
        "fit <- function(X) {",
        "  loss <- function(t) {",
        "    h <- c(X %*% t[seq_len(ncol(X))]) / 2",
        "    e <- if (any(d$y == 0)) t[ncol(X) + 1] else -Inf",
        "    -sum(ifelse(d$y > 0, h, ifelse(d$y < 0, -h, e)) - log(exp(h) + exp(-h) + exp(e)))",
        "  }",
        "  n <- ncol(X) + any(d$y == 0)",
        "  if (n == 0) return(loss(numeric(0)))",
        '  optim(rep(0, n), loss, method = "BFGS", control = list(reltol = 1e-14))$value',
        "}",
        "# Likelihood ratios: they take all choices for independent. The F tests that Visavis",
        "# decides by have errors robust to people who differ in what they like.",
    ]
    for i, row in enumerate(outcome.rows, 1):
        lines.append(
            f"chi2 <- 2 * (fit(X[, term != {i}, drop = FALSE]) - fit(X)); "
            f"line({r_string(str(row['term']))}, chi2, "
            f"pchisq(chi2, sum(term == {i}), lower.tail = FALSE))"
        )
    return lines, ()


def _people_like(outcome: Outcome, lines: list[str]) -> Body:
    """Return the code of choices by people with abilities of their own, where lme4 has the model.

    `lines` make the columns X of the odds and the terms they belong to.
    """
    assert outcome.data is not None  # noqa: S101  # r_code asked
    q = outcome.question
    if q.model.random != "maximal" or (outcome.data[q.dv] == 0).any() or q.model.nodes > 1:
        return ["# Not repeated here: no package of R has this model (ties, or one SD)."], ()
    lines = [
        *lines,
        "own <- X[, term == 1, drop = FALSE]",
        "# Likelihood ratios, by Laplace's approximation. The F tests that Visavis decides by have",
        "# robust errors, which lme4 does not offer.",
        "fit <- function(keep) {",
        '  columns <- if (any(keep)) "0 + X[, keep, drop = FALSE]" else "0"',
        '  f <- as.formula(paste("as.integer(y > 0) ~", columns, "+ (0 + own | s)"))',
        "  environment(f) <- environment()",
        '  lme4::glmer(f, d[c("y", "s")], binomial, control = lme4::glmerControl(',
        '    optimizer = "bobyqa", tolPwrss = 1e-12, check.conv.singular = "ignore"))',
        "}",
        "full <- fit(rep(TRUE, ncol(X)))",
    ]
    for i, row in enumerate(outcome.rows, 1):
        lines.append(
            f"chi2 <- 2 * c(logLik(full) - logLik(fit(term != {i}))); "
            f"line({r_string(str(row['term']))}, chi2, "
            f"pchisq(chi2, sum(term == {i}), lower.tail = FALSE))"
        )
    return lines, ("lme4",)


def _sign(outcome: Outcome, names: Mapping[str, str]) -> Body:
    if not names:
        mu = outcome.question.reference.mu
        return [
            f"r <- off(d$y, {mu!r})",
            "t <- binom.test(sum(r > 0), sum(r != 0))",
            'line("above", t$statistic, t$p.value)',
        ], ()
    call = "{ r <- off(x, y); binom.test(sum(r > 0), sum(r != 0)) }"
    return _two(outcome, names, call, "t$statistic"), ()


def _binomial(outcome: Outcome, names: Mapping[str, str]) -> Body:
    chance_share = outcome.question.reference.mu or 0.5
    return [
        f"t <- binom.test(sum(d$y), nrow(d), {chance_share!r})",
        'line("hits", t$statistic, t$p.value)',
    ], ()


WIDE = "wide <- with(d, tapply(y, list(s, f1), function(v) v))"


def _icc(outcome: Outcome, names: Mapping[str, str]) -> Body:
    return [
        WIDE,
        "t <- suppressWarnings(psych::ICC(wide, lmer = FALSE)$results)",
        "for (i in seq_len(nrow(t))) line(as.character(t$type[i]), t$ICC[i], t$p[i])",
    ], ("psych",)


def _kappa(outcome: Outcome, names: Mapping[str, str]) -> Body:
    scale = outcome.question.reliability.scale or "nominal"
    gap = {"nominal": "diag(k)", "ordinal": "1 - gap", "interval": "1 - gap^2"}[scale]
    return [
        WIDE,
        "wide <- wide[complete.cases(wide), ]; v <- sort(unique(c(wide))); k <- length(v)",
        f"place <- {'v' if scale == 'interval' else 'seq_len(k)'}",
        'gap <- abs(outer(place, place, "-")) / diff(range(place))',
        "p <- unclass(table(factor(wide[, 1], v), factor(wide[, 2], v))) / nrow(wide)",
        f"w <- {gap}; chance <- sum(w * outer(rowSums(p), colSums(p)))",
        'line("kappa", (sum(w * p) - chance) / (1 - chance), NA)',
    ], ()


def _krippendorff(outcome: Outcome, names: Mapping[str, str]) -> Body:
    return [
        WIDE,
        f'a <- irr::kripp.alpha(t(wide), "{outcome.question.reliability.scale}")',
        'line("alpha", a$value, NA)',
    ], ("irr",)


def _friedman(outcome: Outcome, names: Mapping[str, str]) -> Body:
    lines = ["t <- friedman.test(y ~ f1 | s, data = d)", 'line("f1", t$statistic, t$p.value)']
    w = "t$statistic / (nlevels(d$s) * (nlevels(d$f1) - 1))"
    lines.append(f'line("effect f1", {w}, NA)')
    if not outcome.contrasts:
        return lines, ()
    call, V = SIGNED_RANK
    lines += [
        "d <- d[order(d$s), ]",
        *pair_lines(outcome, [f"t <- {call}", f"c({V}, coin::pvalue(t))"]),
    ]
    return lines, ("coin",)


def _conditions(outcome: Outcome, names: Mapping[str, str]) -> Body:
    if outcome.rows[0].get("F") is None:
        return _friedman(outcome, names)
    row = {"term": outcome.question.within[0], **outcome.rows[0]}
    return _rm(_with_rows(outcome, [row]), names)


def _kruskal(outcome: Outcome, names: Mapping[str, str]) -> Body:
    return [
        "t <- kruskal.test(y ~ f1, data = d)",
        'line("f1", t$statistic, t$p.value)',
        'line("effect f1", t$statistic / (nrow(d) - 1), NA)',
        *dunn_lines(outcome),
    ], ()


def _welch(outcome: Outcome, names: Mapping[str, str]) -> Body:
    return [
        "t <- oneway.test(y ~ f1, data = d)",
        'line("f1", t$statistic, t$p.value)',
        *games_howell_lines(outcome),
    ], ()


_BODIES: Mapping[str, Callable[[Outcome, Mapping[str, str]], Body]] = {
    "art": _art,
    "rm": _rm,
    "mixed": _mixed_model,
    "lmm": _lmm,
    "gee": _gee,
    "clmm": _clmm,
    "bradleyterry": _bradley_terry,
    "sign": _sign,
    "binomial": _binomial,
    "icc": _icc,
    "kappa": _kappa,
    "krippendorff": _krippendorff,
    "anova": _anova,
    "welch": _welch,
    "friedman": _friedman,
    "conditions": _conditions,
    "kruskal": _kruskal,
    "paired": _paired_tests,
    "t": _t,
    "wilcoxon": _wilcoxon,
    "mannwhitney": _mann_whitney,
    "shapiro": _shapiro,
    "spearman": _correlation,
    "pearson": _correlation,
    "tost": _tost,
    "cronbach": _cronbach,
}
