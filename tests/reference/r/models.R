# Reference results of mixed models and estimating equations; run from the repository root:
#   Rscript tests/reference/r/models.R
# Writes tests/reference/stats/{lmm,gee}_*.json. The data are made here, from a fixed seed.
suppressMessages({library(lme4); library(lmerTest); library(emmeans); library(geepack); library(jsonlite)})
options(contrasts = c("contr.sum", "contr.poly"))
emm_options(lmer.df = "kenward-roger", pbkrtest.limit = 1e5)
packages <- c("lme4", "lmerTest", "pbkrtest", "emmeans", "geepack")
software <- list(R = paste(R.version$major, R.version$minor, sep = "."),
  packages = setNames(lapply(packages, function(p) as.character(packageVersion(p))), packages))
folder <- "tests/reference/stats"

column <- function(v) if (is.factor(v)) as.character(v) else v
write_case <- function(id, title, data, design, results) {
  factors <- unlist(c(design$between, design$within))
  file <- list(schema = "vr-stats-reference/1", id = id, title = title,
    origin = "synthetic, tests/reference/r/models.R", design = design,
    data = list(n_rows = nrow(data), levels = lapply(data[factors], function(f) as.list(levels(f))),
      columns = lapply(data, column)),
    software = software, results = results)
  write_json(file, file.path(folder, paste0(id, ".json")), auto_unbox = TRUE, digits = 12, na = "null")
}
people <- function(n) sprintf("S%02d", seq_len(n))

# ---- mixed models ----
f_table <- function(m) {
  a <- anova(m, type = 3, ddf = "Kenward-Roger")
  lapply(list(term = rownames(a), F = a[["F value"]], df1 = a$NumDF, df2 = a$DenDF,
    p = a[["Pr(>F)"]]), I)
}
control <- lmerControl(optimizer = "bobyqa", optCtrl = list(rhoend = 1e-10, maxfun = 1e5))
lmm <- function(formula, data, random, contrasts_of = NULL, tolerance = 1e-4) {
  m <- lmer(as.formula(formula), data = data, REML = TRUE, control = control)
  entries <- list(list(procedure = "lmm", call = paste0("lmerTest::lmer(", formula,
      "); anova(type = 3, ddf = 'Kenward-Roger')"), dv = "y", random = random,
    expected = c(f_table(m), list(reml = as.numeric(logLik(m)), residual = sigma(m)^2)), tolerance = list(rel = tolerance, abs = 1e-6)))
  for (factor in contrasts_of) {
    e <- as.data.frame(summary(pairs(emmeans(m, factor), adjust = "holm")))
    level <- strsplit(as.character(e$contrast), " - ")
    entries <- c(entries, list(list(procedure = "lmm_contrasts",
      call = paste0("pairs(emmeans(m, '", factor, "'), adjust = 'holm')"), dv = "y",
      random = random, factor = factor,
      expected = lapply(list(level_1 = sapply(level, `[`, 1), level_2 = sapply(level, `[`, 2),
        estimate = e$estimate, se = e$SE, df = e$df, t = e$t.ratio, p_holm = e$p.value), I),
      tolerance = list(rel = tolerance, abs = 1e-6))))
  }
  entries
}

set.seed(20261)
n <- 18
d <- expand.grid(trial = 1:8, A = c("a1", "a2"), s = people(n), stringsAsFactors = FALSE)
b <- setNames(rnorm(n), people(n)); u <- setNames(rnorm(n, 0, 0.7), people(n))
d$y <- round(5 + b[d$s] + (d$A == "a2") * (0.6 + u[d$s]) + rnorm(nrow(d)), 3)
d$A <- factor(d$A)
write_case("lmm_trials_one", "18 people, one within factor of two levels, 8 trials a cell",
  d[c("s", "A", "y")], list(subject = "s", within = list("A"), between = list()),
  lmm("y ~ A + (A | s)", d, "maximal", "A"))

set.seed(20262)
n <- 24
d <- expand.grid(trial = 1:6, B = c("b1", "b2", "b3"), s = people(n), stringsAsFactors = FALSE)
d$G <- ifelse(as.integer(substr(d$s, 2, 3)) <= 10, "g1", "g2")
b <- setNames(rnorm(n), people(n))
u <- matrix(rnorm(n * 3, 0, 0.8), n, dimnames = list(people(n), c("b1", "b2", "b3")))
d$y <- round(b[d$s] + u[cbind(d$s, d$B)] + 0.5 * (d$B == "b3") + 0.4 * (d$G == "g2") + rnorm(nrow(d)), 3)
d <- d[-c(3, 4, 50, 51, 52, 200, 333), ]
d$B <- factor(d$B); d$G <- factor(d$G)
write_case("lmm_trials_groups", "10 and 14 people, three conditions, 6 trials a cell, 7 trials lost",
  d[c("s", "G", "B", "y")], list(subject = "s", within = list("B"), between = list("G")),
  c(lmm("y ~ G * B + (B | s)", d, "maximal", c("B", "G")),
    lmm("y ~ G * B + (1 | s) + (1 | s:B)", d, "components", "B")))

set.seed(20263)
n <- 16
d <- expand.grid(B = c("b1", "b2", "b3"), A = c("a1", "a2"), s = people(n), stringsAsFactors = FALSE)
b <- setNames(rnorm(n), people(n))
u <- matrix(rnorm(n * 2), n, dimnames = list(people(n), c("a1", "a2")))
v <- matrix(rnorm(n * 3, 0, 0.8), n, dimnames = list(people(n), c("b1", "b2", "b3")))
d$y <- round(b[d$s] + u[cbind(d$s, d$A)] + v[cbind(d$s, d$B)] + 0.5 * (d$B == "b2") + rnorm(nrow(d), 0, 0.7), 3)
d$A <- factor(d$A); d$B <- factor(d$B)
design <- list(subject = "s", within = list("A", "B"), between = list())
components <- "y ~ A * B + (1 | s) + (1 | s:A) + (1 | s:B)"
write_case("lmm_cells_full", "16 people, 2 x 3 cells, people differ in both effects", d[c("s", "A", "B", "y")],
  design, lmm(components, d, "components", c("A", "B")))
d <- d[-c(4, 11, 30, 61, 62), ]
write_case("lmm_cells_missing", "the same with five cells lost", d[c("s", "A", "B", "y")], design,
  lmm(components, d, "components", c("A", "B")))

# ---- estimating equations ----
# Mancl and DeRouen (2001): residuals of each cluster times the inverse of I - H_ii.
mancl_derouen <- function(m) {
  X <- model.matrix(m); mu <- fitted(m); alpha <- m$geese$alpha; family <- m$family
  w <- family$mu.eta(family$linkfun(mu)); v <- family$variance(mu); id <- m$id
  bread <- 0; parts <- list()
  for (k in unique(id)) {
    r <- id == k; nk <- sum(r)
    R <- matrix(alpha, nk, nk); diag(R) <- 1
    V <- diag(sqrt(v[r]), nk) %*% R %*% diag(sqrt(v[r]), nk)
    D <- w[r] * X[r, , drop = FALSE]
    bread <- bread + t(D) %*% solve(V, D)
    parts[[as.character(k)]] <- list(D = D, V = V, e = m$y[r] - mu[r])
  }
  inverse <- solve(bread); meat <- 0
  for (p in parts) {
    H <- p$D %*% inverse %*% t(p$D) %*% solve(p$V)
    g <- t(p$D) %*% solve(p$V, solve(diag(nrow(H)) - H, p$e))
    meat <- meat + g %*% t(g)
  }
  inverse %*% meat %*% inverse
}
gee <- function(formula, data, family) {
  m <- geeglm(as.formula(formula), id = factor(data$s), data = data, family = family, corstr = "exchangeable",
    control = geese.control(epsilon = 1e-12, maxit = 200))
  list(list(procedure = "gee", call = paste0("geepack::geeglm(", formula, ", id = s, family = ", family,
      ", corstr = 'exchangeable'); corrected: Mancl and DeRouen (2001) from its fit"), dv = "y",
    family = family, expected = list(coefficients = unname(coef(m)), alpha = unname(m$geese$alpha),
      se_robust = unname(sqrt(diag(m$geese$vbeta))), se_corrected = sqrt(diag(mancl_derouen(m)))),
    tolerance = list(rel = 1e-4, abs = 1e-6)))
}
set.seed(20264)
n <- 20
d <- expand.grid(trial = 1:5, B = c("b1", "b2", "b3"), s = people(n), stringsAsFactors = FALSE)
d$G <- ifelse(as.integer(substr(d$s, 2, 3)) <= 8, "g1", "g2")
b <- setNames(rnorm(n), people(n))
eta <- b[d$s] + 0.5 * (d$B == "b2") + 0.3 * (d$G == "g2")
d$choice <- rbinom(nrow(d), 1, plogis(eta)); d$count <- rpois(nrow(d), exp(0.5 + 0.4 * eta))
d$score <- round(eta + rnorm(nrow(d)), 3)
d <- d[-c(5, 6, 7, 90, 133, 134, 251), ]
d$B <- factor(d$B); d$G <- factor(d$G)
for (one in list(c("binomial", "choice"), c("poisson", "count"), c("gaussian", "score"))) {
  e <- data.frame(s = d$s, G = d$G, B = d$B, y = d[[one[2]]])
  write_case(paste0("gee_", one[1]), paste("8 and 12 people, three conditions, 5 trials a cell, 7 lost:", one[2]),
    e, list(subject = "s", within = list("B"), between = list("G")), gee("y ~ G * B", e, one[1]))
}
