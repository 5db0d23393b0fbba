# Reference results of agreement and of counts; run from the repository root:
#   Rscript tests/reference/r/agreement.R
# Writes tests/reference/stats/agreement_*.json and signs.json. Krippendorff's alpha is computed
# pair by pair from its definition; his published example (2011) stands beside made ratings.
suppressMessages({library(psych); library(jsonlite)})
packages <- "psych"
software <- list(R = paste(R.version$major, R.version$minor, sep = "."),
  packages = setNames(lapply(packages, function(p) as.character(packageVersion(p))), packages))
write_case <- function(id, title, table, results, sets = list()) {
  file <- list(schema = "vr-stats-reference/1", id = id, title = title,
    origin = "tests/reference/r/agreement.R", design = setNames(list(), character(0)),
    ratings = table, sets = sets, software = software, results = results)
  write_json(file, file.path("tests/reference/stats", paste0(id, ".json")), auto_unbox = TRUE,
    digits = 12, na = "null")
}
tight <- list(rel = 1e-6, abs = 1e-7)

icc <- function(x) {
  t <- suppressWarnings(ICC(x, lmer = FALSE))$results
  list(procedure = "icc", call = "psych::ICC(x, lmer = FALSE)", expected = list(
    kind = I(as.character(t$type)), value = I(t$ICC), F = I(t$F), df1 = I(t$df1), df2 = I(t$df2),
    p = I(t$p), low = I(t$`lower bound`), high = I(t$`upper bound`)), tolerance = tight)
}
kappa <- function(x, scale) {
  values <- sort(unique(c(as.matrix(x)))); values <- values[!is.na(values)]; k <- length(values)
  place <- if (scale == "interval") values else seq_len(k)
  gap <- abs(outer(place, place, "-")) / diff(range(place))
  w <- switch(scale, nominal = diag(k), ordinal = 1 - gap, interval = 1 - gap^2)
  x <- x[complete.cases(x), ]
  f <- table(factor(x[, 1], values), factor(x[, 2], values))
  m <- suppressWarnings(cohen.kappa(unclass(f), w = w))
  # psych's variance of a weighted kappa is not that of Fleiss et al.; the delta method, by number.
  p <- unclass(f) / sum(f); of <- function(p) {
    chance <- sum(w * outer(rowSums(p), colSums(p))) / sum(p)^2
    (sum(w * p) / sum(p) - chance) / (1 - chance)
  }
  g <- sapply(seq_along(p), function(i) {
    h <- replace(0 * p, i, 1e-5); (of(p + h) - of(p - h)) / 2e-5 })
  se <- sqrt((sum(p * g^2) - sum(p * g)^2) / sum(f))
  if (scale == "nominal") stopifnot(abs(se - sqrt(m$var.kappa)) < 1e-7)
  list(procedure = "cohen_kappa", scale = scale, call = "psych::cohen.kappa(table, w)",
    expected = list(value = unname(m$weighted.kappa), se = se), tolerance = tight)
}
alpha <- function(x, scale) {
  x <- as.matrix(x); x <- x[rowSums(!is.na(x)) > 1, , drop = FALSE]
  all <- x[!is.na(x)]; values <- sort(unique(all)); counts <- table(factor(all, values))
  distance <- function(a, b) switch(scale, nominal = as.numeric(a != b), interval = (a - b)^2,
    ratio = if (a + b == 0) 0 else ((a - b) / (a + b))^2,
    ordinal = {
      i <- sort(match(c(a, b), values))
      (sum(counts[i[1]:i[2]]) - (counts[[i[1]]] + counts[[i[2]]]) / 2)^2
    })
  seen <- 0
  for (u in seq_len(nrow(x))) {
    v <- x[u, !is.na(x[u, ])]; m <- length(v)
    for (i in seq_len(m)) for (j in seq_len(m)) if (i != j)
      seen <- seen + distance(v[i], v[j]) / (m - 1)
  }
  n <- length(all); chance <- 0
  for (i in seq_len(n)) for (j in seq_len(n)) if (i != j)
    chance <- chance + distance(all[i], all[j])
  list(procedure = "krippendorff_alpha", scale = scale, call = "from the definition",
    expected = list(value = 1 - (seen / n) / (chance / (n * (n - 1)))), tolerance = tight)
}

# Shrout and Fleiss (1979), table 2: six targets by four judges.
sf <- matrix(c(9, 2, 5, 8, 6, 1, 3, 2, 8, 4, 6, 8, 7, 1, 2, 6, 10, 5, 6, 9, 6, 2, 4, 7), ncol = 4,
  byrow = TRUE)
write_case("agreement_shrout_fleiss", "Shrout and Fleiss (1979): six targets, four judges", sf,
  list(icc(sf), list(procedure = "icc", call = "as printed",
    expected = list(value = I(c(.17, .29, .71, .44, .62, .91))),
    tolerance = list(rel = 0, abs = .0051))))

# Krippendorff (2011), example C: twelve units, four observers, missing ratings.
kr <- t(rbind(c(1, 2, 3, 3, 2, 1, 4, 1, 2, NA, NA, NA), c(1, 2, 3, 3, 2, 2, 4, 1, 2, 5, NA, 3),
  c(NA, 3, 3, 3, 2, 3, 4, 2, 2, 5, 1, NA), c(1, 2, 3, 3, 2, 4, 4, 1, 2, 5, 1, NA)))
scales <- c("nominal", "ordinal", "interval", "ratio")
printed <- c(.743, .815, .849, .797)
write_case("agreement_krippendorff", "Krippendorff (2011): twelve units, four observers", kr,
  c(lapply(scales, function(s) alpha(kr, s)), lapply(1:4, function(i) list(
    procedure = "krippendorff_alpha", scale = scales[i], call = "as printed",
    expected = list(value = printed[i]), tolerance = list(rel = 0, abs = .00051)))))

set.seed(20269)
truth <- rnorm(30)
x <- sapply(1:5, function(r) pmin(pmax(round(4 + 1.2 * truth + rnorm(30, 0.3 * r - 1)), 1), 7))
two <- x[, 1:2]; two[c(4, 19), 2] <- NA; gaps <- x; gaps[cbind(c(1, 1, 1, 8, 20), c(1, 2, 3, 5, 1))] <- NA
write_case("agreement_ratings", "30 clips by five raters, 1-7", x, list(icc(x)))
write_case("agreement_gaps", "30 clips by five raters, five ratings lost", gaps,
  lapply(scales, function(s) alpha(gaps, s)))
write_case("agreement_two", "30 clips by two raters, two lost", two,
  c(lapply(scales[1:3], function(s) kappa(two, s)), lapply(scales[1:3], function(s) alpha(two, s))))

set.seed(20270)
a <- round(rnorm(24, 0.5), 1); b <- round(rnorm(24), 1); a[c(3, 9)] <- b[c(3, 9)]
binom <- function(h, n, p) {
  t <- binom.test(h, n, p)
  list(hits = h, n = n, p = t$p.value, low = t$conf.int[1], high = t$conf.int[2])
}
write_case("signs", "24 pairs, two of them equal, and counts", list(), c(
  list(list(procedure = "sign_test", set = "pairs", call = "binom.test(sum(x > y), sum(x != y))",
    expected = binom(sum(a > b), sum(a != b), .5), tolerance = tight)),
  lapply(list(c(17, 22, .5), c(0, 9, .5), c(31, 40, .6), c(3, 50, .2)), function(v)
    list(procedure = "binomial_test", call = "binom.test(hits, n, p)", given = list(hits = v[1],
      n = v[2], expected = v[3]), expected = binom(v[1], v[2], v[3]), tolerance = tight))),
  list(list(name = "pairs", x = a, y = b)))
