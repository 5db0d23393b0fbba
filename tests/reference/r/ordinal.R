# Reference results of cumulative link (mixed) models; run from the repository root:
#   Rscript tests/reference/r/ordinal.R
# Writes tests/reference/stats/clmm_*.json. The data are made here, from a fixed seed.
suppressMessages({library(ordinal); library(jsonlite)})
options(contrasts = c("contr.sum", "contr.poly"))
packages <- c("ordinal", "ucminf")
software <- list(R = paste(R.version$major, R.version$minor, sep = "."),
  packages = setNames(lapply(packages, function(p) as.character(packageVersion(p))), packages))

column <- function(v) if (is.factor(v)) as.character(v) else v
write_case <- function(id, title, data, design, results) {
  factors <- unlist(c(design$between, design$within))
  file <- list(schema = "vr-stats-reference/1", id = id, title = title,
    origin = "synthetic, tests/reference/r/ordinal.R", design = design,
    data = list(n_rows = nrow(data), levels = lapply(data[factors], function(f) as.list(levels(f))),
      columns = lapply(data, column)),
    software = software, results = results)
  write_json(file, file.path("tests/reference/stats", paste0(id, ".json")), auto_unbox = TRUE,
    digits = 12, na = "null")
}
people <- function(n) sprintf("S%02d", seq_len(n))
rated <- function(z, low, high) pmin(pmax(round(z), low), high)

# Full model and, for every term, the model without its sum-coded columns.
models <- function(factors, data, mixed) {
  X <- model.matrix(as.formula(paste("~", paste(factors, collapse = "*"))), data)
  term <- attr(X, "assign")[-1]; X <- X[, -1, drop = FALSE]
  colnames(X) <- paste0("x", seq_len(ncol(X)))
  d <- data.frame(y = ordered(data$y), s = factor(data$s), X)
  fit <- function(keep) {
    fixed <- if (any(keep)) paste(colnames(X)[keep], collapse = " + ") else "1"
    if (mixed) clmm(as.formula(paste("y ~", fixed, "+ (1 | s)")), data = d, nAGQ = 15,
      control = clmm.control(gradTol = 1e-8, maxIter = 500))
    else clm(as.formula(paste("y ~", fixed)), data = d, control = clm.control(gradTol = 1e-10))
  }
  full <- fit(rep(TRUE, ncol(X)))
  chi2 <- sapply(unique(term), function(t) 2 * (c(logLik(full)) - c(logLik(fit(term != t)))))
  q <- as.integer(table(term))
  list(list(procedure = "clmm", dv = "y",
    call = paste0(if (mixed) "ordinal::clmm(y ~ X + (1 | s), nAGQ = 15)" else "ordinal::clm(y ~ X)",
      ", X the sum-coded ", paste(factors, collapse = " * "), "; 2 (logLik - logLik without term)"),
    expected = list(thresholds = unname(full$alpha), coefficients = unname(full$beta),
      se = unname(sqrt(diag(vcov(full)))[names(full$beta)]), log_likelihood = c(logLik(full)),
      sigma = if (mixed) unname(sqrt(unlist(VarCorr(full)))) else 0,
      chi2 = I(chi2), chi2_p = I(pchisq(chi2, q, lower.tail = FALSE))),
    tolerance = list(rel = 1e-4, abs = 1e-5)))
}

set.seed(20265)
n <- 24
d <- expand.grid(B = c("b1", "b2", "b3"), A = c("a1", "a2"), s = people(n), stringsAsFactors = FALSE)
b <- setNames(rnorm(n, 0, 1.2), people(n))
d$y <- rated(5 + b[d$s] + 0.8 * (d$A == "a2") + 0.5 * (d$B == "b3") + rlogis(nrow(d), 0, 0.7), 1, 7)
d$A <- factor(d$A); d$B <- factor(d$B)
within <- list(subject = "s", within = list("A", "B"), between = list())
write_case("clmm_cells", "24 people, 2 x 3 conditions, one rating 1-7 each, near the ceiling",
  d[c("s", "A", "B", "y")], within, models(c("A", "B"), d, TRUE))

set.seed(20266)
n <- 20
d <- expand.grid(trial = 1:5, B = c("b1", "b2", "b3"), s = people(n), stringsAsFactors = FALSE)
d$G <- ifelse(as.integer(substr(d$s, 2, 3)) <= 8, "g1", "g2")
b <- setNames(rnorm(n), people(n))
d$y <- rated(3 + b[d$s] + 0.6 * (d$B == "b2") + 0.4 * (d$G == "g2") + rlogis(nrow(d), 0, 0.8), 1, 5)
d <- d[-c(5, 6, 7, 90, 133, 134, 251), ]
d$B <- factor(d$B); d$G <- factor(d$G)
write_case("clmm_trials", "8 and 12 people, three conditions, 5 ratings 1-5 a cell, 7 lost",
  d[c("s", "G", "B", "y")], list(subject = "s", within = list("B"), between = list("G")),
  models(c("G", "B"), d, TRUE))

set.seed(20267)
d <- data.frame(s = people(40), G = factor(rep(c("g1", "g2", "g3"), c(10, 14, 16))))
d$y <- rated(3 + 0.7 * (d$G == "g3") + rlogis(40, 0, 0.8), 1, 5)
write_case("clm_groups", "10, 14 and 16 people, one rating each", d[c("s", "G", "y")],
  list(subject = "s", within = list(), between = list("G")), models("G", d, FALSE))

# Random slopes: clmm with a vector-valued random term integrates by Laplace's approximation.
slopes <- function(factors, random, data, is_singular = FALSE) {
  X <- model.matrix(as.formula(paste("~", paste(factors, collapse = "*"))), data)
  term <- attr(X, "assign")[-1]; X <- X[, -1, drop = FALSE]
  labels <- attr(terms(as.formula(paste("~", paste(factors, collapse = "*")))), "term.labels")
  colnames(X) <- paste0("x", seq_len(ncol(X)))
  own <- paste(colnames(X)[labels[term] %in% random], collapse = " + ")
  d <- data.frame(y = ordered(data$y), s = factor(data$s), X)
  fit <- function(keep) {
    fixed <- if (any(keep)) paste(colnames(X)[keep], collapse = " + ") else "1"
    clmm(as.formula(paste("y ~", fixed, "+ (1 +", own, "| s)")), data = d,
      control = clmm.control(gradTol = 1e-6, maxIter = 1000, innerCtrl = "noWarn"))
  }
  full <- fit(rep(TRUE, ncol(X)))
  chi2 <- sapply(unique(term), function(t) 2 * (c(logLik(full)) - c(logLik(fit(term != t)))))
  q <- as.integer(table(term))
  # A correlation of people's effects at its bound leaves clmm short of the peak (its gradient is
  # 8e-5, ours 1e-8 with a higher likelihood), and its standard errors there are not to 1e-4.
  se <- if (!is_singular) list(se = unname(sqrt(diag(vcov(full)))[names(full$beta)]))
  list(procedure = "clmm", dv = "y", random = paste(random, collapse = "+"),
    call = paste0("ordinal::clmm(y ~ X + (1 + ", own, " | s)), X the sum-coded ",
      paste(factors, collapse = " * "), "; 2 (logLik - logLik without term)"),
    expected = c(se, list(thresholds = unname(full$alpha), coefficients = unname(full$beta),
      log_likelihood = c(logLik(full)),
      spread = unname(matrix(VarCorr(full)$s, nrow = nrow(VarCorr(full)$s))),
      chi2 = I(chi2), chi2_p = I(pchisq(chi2, q, lower.tail = FALSE)))),
    tolerance = list(rel = 1e-4, abs = 1e-4))
}

set.seed(20270)
n <- 30
d <- expand.grid(trial = 1:4, B = c("b1", "b2", "b3"), A = c("a1", "a2"), s = people(n),
  stringsAsFactors = FALSE)
i <- match(d$s, people(n)); b <- rnorm(n); a <- 0.5 * b + rnorm(n, 0, 0.8)
e <- cbind(0, rnorm(n, 0, 0.7), rnorm(n, 0, 1))
d$y <- rated(3 + b[i] + (0.5 + a[i]) * (d$A == "a2") +
  e[cbind(i, match(d$B, c("b1", "b2", "b3")))] + 0.4 * (d$B == "b3") + rlogis(nrow(d), 0, 0.8), 1, 5)
d <- d[-c(3, 77, 190, 191, 400), ]
d$A <- factor(d$A); d$B <- factor(d$B)
write_case("clmm_slopes", "30 people who differ in A and B, 2 x 3 conditions, 4 ratings 1-5 each",
  d[c("s", "A", "B", "y")], within, list(slopes(c("A", "B"), "A", d),
  slopes(c("A", "B"), c("A", "B"), d)))

# Bitterness of wine (Randall 1989), ordinal's own example: judges are the people.
data(wine)
d <- data.frame(s = as.character(wine$judge), temp = wine$temp, contact = wine$contact,
  y = as.integer(wine$rating))
write_case("clmm_wine", "Bitterness of wine by temperature and contact, nine judges (ordinal's data)",
  d, list(subject = "s", within = list("temp", "contact"), between = list()),
  list(models(c("temp", "contact"), d, TRUE)[[1]], slopes(c("temp", "contact"), "temp", d, TRUE)))
