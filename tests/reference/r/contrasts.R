# Reference results of contrasts of every model, by emmeans; run from the repository root:
#   Rscript tests/reference/r/contrasts.R
# Writes tests/reference/stats/contrasts_*.json. Designs and data are drawn here, from a fixed seed:
# sizes of groups, effects, people and correlations of conditions all vary. The multivariate t of a
# family is mvtnorm's, at a precision that emmeans does not ask it for.
suppressMessages({library(lme4); library(emmeans); library(geepack); library(ordinal);
  library(mvtnorm); library(jsonlite)})
options(contrasts = c("contr.sum", "contr.poly"))
emm_options(lmer.df = "kenward-roger", pbkrtest.limit = 1e5, msg.nesting = FALSE, opt.digits = FALSE)
packages <- c("lme4", "pbkrtest", "emmeans", "geepack", "ordinal", "mvtnorm")
software <- list(R = paste(R.version$major, R.version$minor, sep = "."),
  packages = setNames(lapply(packages, function(p) as.character(packageVersion(p))), packages))
count <- 0

column <- function(v) if (is.factor(v)) as.character(v) else v
write_case <- function(id, title, data, between, within, results) {
  factors <- c(between, within)
  file <- list(schema = "vr-stats-reference/1", id = id, title = title,
    origin = "synthetic, tests/reference/r/contrasts.R",
    design = list(subject = "s", between = I(between), within = I(within)),
    data = list(n_rows = nrow(data), levels = lapply(data[factors], function(f) I(levels(f))),
      columns = lapply(data[c("s", factors, "y")], column)),
    software = software, results = results)
  write_json(file, file.path("tests/reference/stats", paste0(id, ".json")), auto_unbox = TRUE,
    digits = 12, na = "null")
}

# ---- what is asked of every model: list(kind, term, by, weights) ----
comma <- function(text) gsub(" ", ",", text, fixed = TRUE)
sides <- function(e, column = "contrast") {
  parts <- strsplit(as.character(e[[column]]), " - ", fixed = TRUE)
  list(level_1 = comma(sapply(parts, `[`, 1)), level_2 = comma(sapply(parts, `[`, 2)))
}
t_of <- function(e) if (is.null(e$t.ratio)) e$z.ratio else e$t.ratio
numbers <- function(e) list(estimate = e$estimate, se = e$SE, df = e$df, t = t_of(e), p_none = e$p.value)
mvt <- function(contrast) {
  e <- as.data.frame(summary(contrast, adjust = "none")); V <- vcov(contrast)
  R <- cov2cor(V); df <- unique(round(e$df, 6))
  if (length(df) > 1 || nrow(R) < 2 || any(!is.finite(df))) return(NULL)
  fine <- GenzBretz(maxpts = 2e6, abseps = 2e-6)
  if (abs(df - round(df)) > 1e-9) return(NULL)
  sapply(abs(t_of(e)), function(t) 1 - pmvt(rep(-t, nrow(R)), rep(t, nrow(R)), df = round(df),
    corr = R, algorithm = fine)[1])
}
asked <- function(m, what, call, tolerance, more = list(), ...) {
  spec <- as.formula(paste("~", paste(what$term, collapse = " * "),
    if (length(what$by)) paste("|", paste(what$by, collapse = " * "))))
  weights <- if (is.null(what$weights)) "equal" else what$weights
  grid <- emmeans(m, spec, weights = weights, ...)
  entry <- c(list(procedure = paste0("contrasts_", what$kind), call = call, dv = "y",
    term = I(what$term), weights = weights, tolerance = list(rel = tolerance, abs = tolerance)), more)
  if (length(what$by)) entry$by <- I(what$by)
  if (what$kind == "pairs" || what$kind == "simple") {
    one <- contrast(grid, "pairwise")
    e <- as.data.frame(summary(one, adjust = "none"))
    expected <- c(sides(e), numbers(e))
    for (way in c("tukey", "holm")) expected[[paste0("p_", way)]] <-
      as.data.frame(summary(one, adjust = way))$p.value
    if (length(what$by)) expected$at <- comma(do.call(paste, lapply(e[what$by], as.character)))
    else if (isTRUE(what$mvt)) entry$p_mvt <- mvt(one)
  } else if (what$kind == "interaction") {
    e <- as.data.frame(summary(contrast(grid, interaction = "pairwise"), adjust = "none"))
    expected <- c(setNames(lapply(paste0(what$term, "_pairwise"), function(c) as.character(e[[c]])),
      paste0("contrast_", seq_along(what$term))), numbers(e))
    expected$p_holm <- p.adjust(e$p.value, "holm")
  } else {
    levels <- comma(do.call(paste, lapply(as.data.frame(grid)[what$term], as.character)))
    set.seed(nchar(paste(levels, collapse = "")))
    rows <- lapply(1:4, function(i) { w <- sample(-3:3, length(levels), TRUE); w[1] <- w[1] - sum(w); w })
    rows <- Filter(function(w) any(w != 0), rows)
    names(rows) <- paste("hypothesis", seq_along(rows))
    one <- contrast(grid, rows)
    e <- as.data.frame(summary(one, adjust = "none"))
    entry$hypotheses <- lapply(rows, function(w) as.list(setNames(w, levels)))
    expected <- c(list(name = names(rows)), numbers(e), list(p_holm = p.adjust(e$p.value, "holm")))
    if (isTRUE(what$mvt)) entry$p_mvt <- mvt(one)
  }
  count <<- count + nrow(e)
  if (!is.null(entry$p_mvt)) entry$p_mvt <- I(entry$p_mvt)
  entry$expected <- lapply(expected, function(v) I(ifelse(is.infinite(v), NA, v)))
  entry
}
pairs_of <- function(...) list(kind = "pairs", term = c(...), mvt = TRUE)
simple <- function(term, by) list(kind = "simple", term = term, by = by)
double <- function(...) list(kind = "interaction", term = c(...))
any_sum <- function(...) list(kind = "hypotheses", term = c(...), mvt = TRUE)
weighted <- function(w, ...) list(kind = "pairs", term = c(...), weights = w)
people <- function(n) sprintf("S%02d", seq_len(n))

# ---- between groups: lm ----
groups <- function(sizes, levels) {  # sizes of every cell, the first factor's levels fastest
  cells <- expand.grid(levels)
  d <- cells[rep(seq_len(nrow(cells)), sizes), , drop = FALSE]
  d$s <- people(nrow(d)); rownames(d) <- NULL
  effects <- rnorm(nrow(cells)); d$y <- round(effects[rep(seq_len(nrow(cells)), sizes)] + rnorm(nrow(d)), 3)
  d
}
of_lm <- function(id, title, d, between, formula, what) {
  m <- lm(formula, d)
  write_case(id, title, d, between, character(0), lapply(what, function(w)
    asked(m, w, paste0("emmeans(lm(", deparse(formula), "))"), 1e-8, list(test = "anova"))))
}
set.seed(20370)
d <- groups(sample(3:9, 6, TRUE), list(A = c("a1", "a2"), B = c("b1", "b2", "b3")))
of_lm("contrasts_between_two", "2 x 3 groups of unequal size", d, c("A", "B"), y ~ A * B, list(
  pairs_of("A"), pairs_of("B"), pairs_of("A", "B"), simple("A", "B"), simple("B", "A"),
  double("A", "B"), any_sum("B"), any_sum("A", "B"), weighted("proportional", "A"),
  weighted("proportional", "B"), weighted("cells", "A"), weighted("cells", "B")))
d <- groups(sample(2:6, 12, TRUE), list(A = c("a1", "a2"), B = c("b1", "b2"), C = c("c1", "c2", "c3")))
of_lm("contrasts_between_three", "2 x 2 x 3 groups of unequal size", d, c("A", "B", "C"), y ~ A * B * C,
  list(pairs_of("A"), pairs_of("C"), pairs_of("A", "C"), simple("C", c("A", "B")), simple("B", "C"),
    double("A", "C"), double("A", "B", "C"), any_sum("B", "C"), weighted("proportional", "B"),
    weighted("cells", "C"), weighted("proportional", "A", "B")))
d <- groups(c(5, 9, 7, 4), list(A = paste0("a", 1:4)))
of_lm("contrasts_between_one", "four groups of unequal size", d, "A", y ~ A, list(pairs_of("A"), any_sum("A")))

# ---- within, and mixed: the multivariate linear model of people's cells ----
cells <- function(n_of_group, levels_b, levels_w, spread = 1) {
  group <- expand.grid(levels_b); if (!nrow(group)) group <- data.frame(row.names = 1)
  w <- expand.grid(levels_w)
  q <- nrow(w); G <- length(n_of_group)
  root <- matrix(rnorm(q * q), q) / sqrt(q) + diag(q) * spread
  wide <- do.call(rbind, lapply(seq_len(G), function(g)
    sweep(matrix(rnorm(n_of_group[g] * q), ncol = q) %*% root, 2, rnorm(q, 0, 0.8), "+")))
  wide <- round(wide + rnorm(nrow(wide)), 3)
  which <- rep(seq_len(G), n_of_group)
  d <- do.call(rbind, lapply(seq_len(q), function(j) {
    row <- data.frame(s = people(nrow(wide)), y = wide[, j])
    for (f in names(group)) row[[f]] <- group[which, f]
    for (f in names(w)) row[[f]] <- w[j, f]
    row
  }))
  list(long = d, wide = wide, group = group[which, , drop = FALSE])
}
of_mlm <- function(id, title, made, between, levels_w, what) {
  e <- c(list(wide = made$wide), as.list(made$group))
  formula <- as.formula(paste("wide ~", if (length(between)) paste(between, collapse = " * ") else "1"))
  m <- lm(formula, e)
  write_case(id, title, made$long, between, names(levels_w), lapply(what, function(w)
    asked(m, w, paste0("emmeans(lm(", deparse(formula), "), mult.levs)"), 1e-8, list(test = "rm"),
      mult.levs = levels_w)))
}
set.seed(20371)
w <- list(A = c("a1", "a2"), B = c("b1", "b2", "b3"))
of_mlm("contrasts_within", "12 people, 2 x 3 conditions", cells(12, list(), w), character(0), w,
  list(pairs_of("A"), pairs_of("B"), pairs_of("A", "B"), simple("A", "B"), simple("B", "A"),
    double("A", "B"), any_sum("B"), any_sum("A", "B")))
g <- list(G = c("g1", "g2", "g3"))
of_mlm("contrasts_mixed_one", "groups of 4, 7 and 6 with 2 x 3 conditions", cells(c(4, 7, 6), g, w), "G", w,
  list(pairs_of("G"), pairs_of("B"), pairs_of("G", "A"), simple("G", "B"), simple("B", "G"),
    double("G", "B"), double("G", "A", "B"), any_sum("G"), any_sum("G", "A"),
    weighted("proportional", "B"), weighted("proportional", "A")))
g <- list(G = c("g1", "g2"), H = c("h1", "h2", "h3"))
w <- list(A = c("a1", "a2", "a3"))
of_mlm("contrasts_mixed_two", "2 x 3 groups of 3 to 7 with 3 conditions", cells(c(3, 7, 5, 4, 6, 3), g, w),
  c("G", "H"), w, list(pairs_of("G"), pairs_of("H"), pairs_of("A"), simple("H", "G"), simple("G", "A"),
    simple("A", c("G", "H")), double("G", "H"), double("H", "A"), any_sum("H"), any_sum("G", "A"),
    weighted("proportional", "G"), weighted("proportional", "H")))

# ---- the errors of strata: aov ----
set.seed(20372)
w <- list(A = c("a1", "a2"), B = c("b1", "b2", "b3"))
of_aov <- function(id, title, made, between, formula, what) {
  m <- aov(formula, made$long)
  write_case(id, title, made$long, between, names(w), lapply(what, function(x)
    asked(m, x, paste0("emmeans(aov(", deparse(formula, 200), "))"), 1e-8,
      list(test = "rm", error = "pooled"))))
}
made <- cells(11, list(), w)
for (f in c("A", "B", "s")) made$long[[f]] <- factor(made$long[[f]])
of_aov("contrasts_strata_within", "11 people, 2 x 3 conditions, errors of strata", made, character(0),
  y ~ A * B + Error(s / (A * B)), list(pairs_of("A"), pairs_of("B"), pairs_of("A", "B"),
    simple("A", "B"), simple("B", "A"), double("A", "B"), any_sum("B")))

# ---- mixed models, Kenward-Roger ----
set.seed(20373)
control <- lmerControl(optimizer = "bobyqa", optCtrl = list(rhoend = 1e-11, maxfun = 1e5))
n <- 18
d <- expand.grid(trial = 1:3, B = c("b1", "b2", "b3"), A = c("a1", "a2"), s = people(n))
d$G <- factor(ifelse(as.integer(d$s) <= 7, "g1", "g2"))
at <- as.integer(d$s)
slope <- matrix(rnorm(n * 5, 0, 0.6), n)
d$y <- round(rnorm(n)[at] + 0.7 * (d$A == "a2") + 0.4 * (d$B == "b3") * (d$G == "g2") +
  slope[cbind(at, as.integer(d$A))] + slope[cbind(at, 2 + as.integer(d$B))] +
  rnorm(n * 6, 0, 0.6)[as.integer(interaction(d$s, d$A, d$B))] + rnorm(nrow(d)), 3)
d <- d[-sample(nrow(d), 20), ]
formula <- y ~ G * A * B + (1 | s) + (1 | s:A) + (1 | s:B) + (1 | s:A:B)
m <- lmer(formula, d, control = control)
write_case("contrasts_lmm", "18 people in two groups, three trials in 2 x 3 conditions, 20 lost", d, "G",
  c("A", "B"), lapply(list(pairs_of("G"), pairs_of("A"), pairs_of("B"), pairs_of("A", "B"),
    simple("B", "G"), simple("A", c("G", "B")), double("G", "B"), double("A", "B"), any_sum("B")),
    function(w) asked(m, w, "emmeans(lmer(one variance per effect))", 1e-5,
      list(test = "lmm", random = "components"))))

# ---- estimating equations with plain robust errors, cumulative links by likelihood ----
set.seed(20374)
n <- 26
d <- expand.grid(trial = 1:6, B = c("b1", "b2", "b3"), s = people(n))
d$G <- factor(ifelse(as.integer(d$s) %% 2 == 0, "g1", "g2")); at <- as.integer(d$s)
d$y <- rbinom(nrow(d), 1, plogis(rnorm(n, 0, 0.7)[at] + 0.6 * (d$B == "b2") - 0.5 * (d$G == "g2")))
d <- d[-sample(nrow(d), 15), ]
m <- geeglm(y ~ G * B, id = s, data = d, family = binomial, corstr = "exchangeable",
  control = geese.control(epsilon = 1e-12, maxit = 200))
what <- list(pairs_of("G"), pairs_of("B"), pairs_of("G", "B"), simple("B", "G"), double("G", "B"), any_sum("B"))
write_case("contrasts_gee", "26 people in two groups, six choices in three conditions, 15 lost", d, "G", "B",
  lapply(what, function(w) asked(m, w, "emmeans(geeglm(binomial, exchangeable))", 1e-5,
    list(test = "gee", family = "binomial"))))
d$y <- pmin(5, pmax(1, round(3 + rnorm(n, 0, 0.9)[as.integer(d$s)] + 0.6 * (d$B == "b3") +
  0.4 * (d$G == "g1") + rnorm(nrow(d)))))
d$rating <- ordered(d$y)
m <- clmm(rating ~ G * B + (1 | s), data = d, nAGQ = 15, Hess = TRUE,
  control = clmm.control(gradTol = 1e-8))
write_case("contrasts_clmm", "26 people in two groups, ratings in three conditions", d, "G", "B",
  lapply(what, function(w) asked(m, w, "emmeans(clmm(nAGQ = 15))", 1e-4, list(test = "clmm"))))

# ---- ART-C: the ranks aligned for the factors compared, joined to one ----
ranks <- function(d, term, rest) {
  d$J <- interaction(d[term], sep = " ", lex.order = TRUE)
  all <- c("J", rest)
  mean_in <- function(u) if (length(u)) ave(d$y, interaction(d[u])) else rep(mean(d$y), nrow(d))
  d$rank <- rank(round(d$y - mean_in(all) + mean_in("J") - mean(d$y), 8))
  d
}
art <- function(d, term, rest, fit, call) {
  d <- ranks(d, term, rest)
  m <- fit(d)
  e <- summary(contrast(emmeans(m, ~ J), "pairwise"), adjust = "none")
  one <- as.data.frame(e); count <<- count + nrow(one)
  expected <- c(sides(one), numbers(one), list(p_tukey = as.data.frame(summary(
    contrast(emmeans(m, ~ J), "pairwise"), adjust = "tukey"))$p.value))
  list(procedure = "contrasts_art", call = call, dv = "y", term = I(term), weights = "equal",
    tolerance = list(rel = 1e-5, abs = 1e-5), expected = lapply(expected, I))
}
set.seed(20375)
d <- groups(sample(4:8, 6, TRUE), list(A = c("a1", "a2"), B = c("b1", "b2", "b3")))
write_case("contrasts_art_between", "2 x 3 groups, aligned ranks", d, c("A", "B"), character(0), list(
  art(d, "A", "B", function(d) lm(rank ~ J * B, d), "emmeans(lm(rank ~ A * B))"),
  art(d, "B", "A", function(d) lm(rank ~ J * A, d), "emmeans(lm(rank ~ B * A))"),
  art(d, c("A", "B"), character(0), function(d) lm(rank ~ J, d), "emmeans(lm(rank ~ AB))")))
made <- cells(10, list(), w); d <- made$long; d$s <- factor(d$s)
for (f in c("A", "B")) d[[f]] <- factor(d[[f]])
write_case("contrasts_art_within", "10 people, 2 x 3 conditions, aligned ranks", d, character(0), c("A", "B"),
  list(art(d, "A", "B", function(d) aov(rank ~ J * B + Error(s / (J * B)), d), "emmeans(aov(Error))"),
    art(d, "B", "A", function(d) aov(rank ~ J * A + Error(s / (J * A)), d), "emmeans(aov(Error))"),
    art(d, c("A", "B"), character(0), function(d) aov(rank ~ J + Error(s / J), d), "emmeans(aov(Error))")))
cat(count, "contrasts\n")
