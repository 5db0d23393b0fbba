# Reference Bayes factors of t tests; run from the repository root: Rscript tests/reference/r/bayes.R
# Writes tests/reference/stats/bayes_t.json.
suppressMessages({library(BayesFactor); library(jsonlite)})
cases <- list(c(0.3, 8, 0), c(2.5, 6, 0), c(-4, 23, 0), c(2.2, 400, 0), c(9, 30, 0),
  c(0.1, 12, 12), c(2.5, 6, 18), c(-3.3, 40, 25))
results <- lapply(cases, function(k) {
  n2 <- if (k[3] > 0) k[3] else 0
  list(procedure = "jzs_bayes_factor", call = sprintf("ttest.tstat(t = %g, n1 = %g, n2 = %g)", k[1], k[2], k[3]),
    t = k[1], n_1 = k[2], n_2 = k[3],
    expected = list(bf10 = exp(ttest.tstat(t = k[1], n1 = k[2], n2 = n2)$bf),
      bf10_wide = exp(ttest.tstat(t = k[1], n1 = k[2], n2 = n2, rscale = "wide")$bf)),
    tolerance = list(rel = 1e-4, abs = 0))
})
set.seed(20266)
s <- rep(1:12, 2); cond <- rep(c("p", "q"), each = 12)
y <- round(c(rnorm(12), rnorm(12, 0.7)), 2)
results <- c(results, list(list(procedure = "answer", question = list(test = "t", dv = "y",
    within = I("cond"), subject = "s", bayes = TRUE), call = "ttestBF(paired = TRUE)",
  expected = list(title = "Paired t test", row = list(BF10 = extractBF(ttestBF(y[1:12], y[13:24], paired = TRUE))$bf)),
  tolerance = list(rel = 1e-4, abs = 0))))
write_json(list(schema = "vr-stats-reference/1", id = "bayes_t", title = "JZS Bayes factors of t tests",
  origin = "synthetic, tests/reference/r/bayes.R", data = list(columns = list(s = s, cond = cond, y = y)),
  software = list(R = paste(R.version$major, R.version$minor, sep = "."),
    packages = list(BayesFactor = as.character(packageVersion("BayesFactor")))),
  results = results), "tests/reference/stats/bayes_t.json", auto_unbox = TRUE, digits = 12)
