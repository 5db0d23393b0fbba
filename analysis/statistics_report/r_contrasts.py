"""R code that repeats the contrasts of a test, each family by emmeans from the model's R object.

Lines are named "contrast FAMILY: PAIR", those of effect sizes "effect …"; the value is t (z or V),
or where R has other errors than Visavis the estimate, without p.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations, groupby, product

from visavis.analysis.statistics.results import Row
from visavis.analysis.statistics_report.outcome import Outcome
from visavis.analysis.statistics_report.r_values import r_string, r_vector

DOUBLE = ", differences of differences"
COMPARE = """pairs_of <- function(k) t(apply(combn(k, 2), 2, function(p) replace(numeric(k), p, c(1, -1))))
adjusted <- function(t, df, p, way, k) switch(way,
  tukey = ptukey(abs(t) * sqrt(2), k, df, lower.tail = FALSE), p.adjust(p, way))
compare <- function(g, term, double, way, labels, show = "t", among = NULL) {
  # Cells in the order of the labels: the last factor's levels are neighbours.
  at <- do.call(order, lapply(term, function(f) match(g@grid[[f]], g@levels[[f]])))
  k <- sapply(g@levels[term], length)
  C <- if (double) Reduce(kronecker, lapply(k, pairs_of)) else pairs_of(prod(k))
  C[, at] <- C
  if (!is.null(among)) { C <- C[among, , drop = FALSE]; k <- (1 + sqrt(1 + 8 * nrow(C))) / 2 }
  rows <- setNames(lapply(seq_len(nrow(C)), function(i) C[i, ]), labels)
  s <- as.data.frame(summary(emmeans::contrast(g, rows), adjust = if (way == "mvt") "mvt" else "none"))
  t <- s$estimate / s$SE
  p <- if (way == "mvt") s$p.value else adjusted(t, s$df, s$p.value, way, prod(k))
  for (i in seq_along(t)) line(paste("contrast", labels[i]), if (show == "t") t[i] else s$estimate[i],
    if (show == "t") p[i] else NA)
  invisible(t)
}"""  # noqa: E501  # lines of R
WIDE_MODEL = """wide <- tapply(d$y, list(d$s, interaction(d[within])), mean)
groups <- d[match(rownames(wide), d$s), , drop = FALSE]
m <- lm(as.formula(paste("wide ~", if (length(between)) paste(between, collapse = " * ") else "1")), groups)
grid <- function(term) emmeans::emmeans(m, term, mult.levs = lapply(d[within], levels))"""  # noqa: E501  # lines of R
GRID = "grid <- function(term) emmeans::emmeans(m, term)"
OPTIONS = 'emmeans::emm_options(lmer.df = "kenward-roger")'
WAY = {"bh": "BH"}


def families(outcome: Outcome) -> list[tuple[str, list[Row]]]:
    """Return the contrasts of an outcome by family, in their order."""
    return [
        (str(name), list(rows)) for name, rows in groupby(outcome.contrasts, lambda c: c["family"])
    ]


def marginal_lines(
    outcome: Outcome, names: Mapping[str, str], model: Sequence[str], *, show: str = "t"
) -> list[str]:
    """Return code that repeats every family from a model; `model` makes `m` and `grid`.

    `show` "estimate" leaves p out. Empty without contrasts.
    """
    if not outcome.contrasts:
        return []
    lines = [OPTIONS, COMPARE, *model]
    for family, rows in families(outcome):
        term = [names[f] for f in _factors_of(family)]
        lines.append(compare_line(term, family, rows, show, _simple_pairs(outcome, family)))
        lines += _effect_lines(outcome, rows, family_labels(family, rows))
    return lines


def _factors_of(family: str) -> list[str]:
    """Return the factors of a family; of simple effects the one compared, then the other."""
    name, at, level = family.removesuffix(DOUBLE).partition(" at ")
    return [name, level.partition(" = ")[0]] if at else name.split(":")


def _simple_pairs(outcome: Outcome, family: str) -> list[int]:
    """Return which pairs of the cells of two factors are a family of simple effects, from 1.

    None for other families.
    """
    _, at, level = family.partition(" at ")
    if not at or outcome.data is None:
        return []
    name, other = _factors_of(family)
    sizes = [len(outcome.data[f].cat.categories) for f in (name, other)]
    here = list(map(str, outcome.data[other].cat.categories)).index(level.partition(" = ")[2])
    cells = combinations(product(range(sizes[0]), range(sizes[1])), 2)
    return [i for i, (a, b) in enumerate(cells, start=1) if a[1] == here == b[1]]


def compare_line(
    term: Sequence[str],
    family: str,
    rows: Sequence[Row],
    show: str = "t",
    among: Sequence[int] = (),
) -> str:
    """Return the call that compares the cells of R's factors `term` from `grid`.

    `among` are the pairs of cells that are compared, from 1; all where left out.
    """
    way = str(rows[0]["adjustment"])
    pairs = f", c({', '.join(map(str, among))})" if among else ""
    return (
        f"t <- suppressMessages(compare(grid({r_vector(term)}), {r_vector(term)}, "
        f"{str(family.endswith(DOUBLE)).upper()}, {r_string(WAY.get(way, way))}, "
        f"{r_vector(family_labels(family, rows))}, {r_string(show)}{pairs}))"
    )


def family_labels(family: str, rows: Sequence[Row]) -> list[str]:
    """Return the names of a family's lines."""
    return [f"{family}: {row['contrast']}" for row in rows]


def _effect_lines(outcome: Outcome, rows: Sequence[Row], labels: Sequence[str]) -> list[str]:
    """Return code for dz of conditions without groups, and d of the groups of one factor."""
    q = outcome.question
    kind = rows[0].get("effect")
    if kind == "dz" and not q.between:
        size = "t / sqrt(nlevels(d$s))"
    elif kind == "d" and not q.within and len(q.between) == 1:
        size = "t * sqrt(colSums(combn(c(1 / table(d$f1)), 2)))"
    else:
        return []
    return [
        f"e <- {size}; l <- {r_vector(labels)}",
        'for (i in seq_along(e)) line(paste("effect", l[i]), e[i], NA)',
    ]


def pair_lines(outcome: Outcome, body: Sequence[str]) -> list[str]:
    """Return code that compares the levels of one factor two by two.

    `body` gives statistic and p of the values x and y at the levels two[1] and two[2]; p are
    adjusted as the outcome's.
    """
    if not outcome.contrasts:
        return []
    rows = outcome.contrasts
    way = str(rows[0]["adjustment"])
    pairs = [r_vector([str(r["level_1"]), str(r["level_2"])]) for r in rows]
    labels = [f"{r['family']}: {r['level_1']} - {r['level_2']}" for r in rows]
    return [
        f"found <- sapply(list({', '.join(pairs)}), function(two) {{",
        "  x <- d$y[d$f1 == two[1]]; y <- d$y[d$f1 == two[2]]",
        *(f"  {line}" for line in body),
        "})",
        f"l <- {r_vector(labels)}; p <- p.adjust(found[2, ], {r_string(WAY.get(way, way))})",
        'for (i in seq_along(p)) line(paste("contrast", l[i]), found[1, i], p[i])',
    ]


def games_howell_lines(outcome: Outcome) -> list[str]:
    """Return code of Welch's t of every pair of groups, by Tukey's range or adjusted."""
    if not outcome.contrasts:
        return []
    way = str(outcome.contrasts[0]["adjustment"])
    labels = [f"{row['family']}: {row['contrast']}" for row in outcome.contrasts]
    p = (
        "ptukey(abs(found[1, ]) * sqrt(2), nlevels(d$f1), found[2, ], lower.tail = FALSE)"
        if way == "tukey"
        else f"p.adjust(found[3, ], {r_string(WAY.get(way, way))})"
    )
    return [
        "found <- apply(combn(levels(d$f1), 2), 2, function(two) {",
        "  t <- t.test(d$y[d$f1 == two[1]], d$y[d$f1 == two[2]])",
        "  c(t$statistic, t$parameter, t$p.value)",
        "})",
        f"p <- {p}; l <- {r_vector(labels)}",
        'for (i in seq_along(p)) line(paste("contrast", l[i]), found[1, i], p[i])',
    ]


def dunn_lines(outcome: Outcome) -> list[str]:
    """Return code of Dunn's (1964) comparison of mean ranks, corrected for ties."""
    if not outcome.contrasts:
        return []
    body = [
        "i <- d$f1 == two[1]; j <- d$f1 == two[2]",
        "z <- (mean(r[i]) - mean(r[j])) / sqrt(spread * (1 / sum(i) + 1 / sum(j)))",
        "c(z, 2 * pnorm(-abs(z)))",
    ]
    return [
        "r <- rank(d$y); N <- nrow(d); ties <- table(r)",
        "spread <- N * (N + 1) / 12 - sum(ties^3 - ties) / (12 * (N - 1))",
        *pair_lines(outcome, body),
    ]


def aligned_lines(outcome: Outcome, names: Mapping[str, str]) -> list[str]:
    """Return code of ART-C: ranks aligned for the factors compared, joined to J, by their stratum.

    `response` and `aligned_ranks` stand before it. Beside groups with conditions it is a comment:
    R's strata are no model of groups of unequal size.
    """
    if not outcome.contrasts:
        return []
    q = outcome.question
    if q.within and q.between:
        return ["# Contrasts of aligned ranks beside groups are not repeated here."]
    lines = [OPTIONS, COMPARE, GRID]
    every = list(names.values())
    for family, rows in families(outcome):
        term = [names[f] for f in _factors_of(family)]
        among = _simple_pairs(outcome, family)
        factors = every
        if not family.endswith(DOUBLE):
            factors = ["J", *(f for f in every if f not in term)]
            lines.append(f"d$J <- interaction(d[{r_vector(term)}], lex.order = TRUE)")
            term = ["J"]
        formula = " * ".join(factors)
        fit = f"lm(y ~ {formula}, d)"
        if q.within:
            fit = f"aov(y ~ {formula} + Error(s / ({formula})), d)"
        lines += [
            "d$y <- response",
            f"d$y <- aligned_ranks({r_vector(term)}, {r_vector(factors)})",
            f"m <- {fit}",
            compare_line(term, family, rows, among=among),
        ]
    return lines
