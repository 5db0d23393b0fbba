# Reference results that pin the name of every test of groups to its numbers, on groups whose sizes
# and variances differ, and of exact rank tests with ties. Run from the repository root:
#   Rscript tests/reference/r/named_tests.R
# Writes tests/reference/stats/named_*.json.
suppressMessages({library(coin); library(car); library(jsonlite)})
packages <- c("coin", "car")
software <- list(R = paste(R.version$major, R.version$minor, sep = "."),
  packages = setNames(lapply(packages, function(p) as.character(packageVersion(p))), packages))
write_case <- function(id, title, columns, results) {
  write_json(list(schema = "vr-stats-reference/1", id = id, title = title,
    origin = "synthetic, tests/reference/r/named_tests.R", data = list(columns = as.list(columns)),
    software = software, results = results), file.path("tests/reference/stats", paste0(id, ".json")),
    auto_unbox = TRUE, digits = 15, na = "null")
}
asked <- function(test, title, call, expected, ..., abs = 1e-9)
  list(procedure = "answer", question = c(list(test = test, dv = "y"), list(...)), call = call,
    expected = c(list(title = title), expected), tolerance = list(rel = 1e-8, abs = abs))

# ---- two groups: 6 with SD 3, 18 with SD 1 ----
set.seed(20265)
d <- data.frame(g = rep(c("few", "many"), c(6, 18)), y = round(c(rnorm(6, 1, 3), rnorm(18)), 2))
welch <- t.test(y ~ g, d); student <- t.test(y ~ g, d, var.equal = TRUE)
exact <- wilcox_test(y ~ factor(g), d, distribution = "exact")
write_case("named_two_groups", "6 people with SD 3 and 18 with SD 1", d, list(
  asked("t", "Welch's t test", "t.test(y ~ g)", list(row = list(t = unname(welch$statistic),
    df = unname(welch$parameter), p = welch$p.value, ci_low = welch$conf.int[1],
    ci_high = welch$conf.int[2])), between = I("g")),
  asked("t", "Student's t test", "t.test(y ~ g, var.equal = TRUE)", list(row = list(
    t = unname(student$statistic), df = unname(student$parameter), p = student$p.value,
    ci_low = student$conf.int[1], ci_high = student$conf.int[2])), between = I("g"),
    equal_variances = TRUE),
  asked("mannwhitney", "Mann-Whitney test", "wilcox.test(y ~ g); coin::wilcox_test(exact)", list(
    row = list(U = unname(suppressWarnings(wilcox.test(y ~ g, d))$statistic),
    p = as.numeric(pvalue(exact)))), between = I("g"))))

# ---- three groups ----
d <- data.frame(g = rep(c("a", "b", "c"), c(5, 9, 16)),
  y = round(c(rnorm(5, 1.5, 3), rnorm(9, 0, 2), rnorm(16, 0.4, 0.6)), 2))
w <- oneway.test(y ~ g, d); a <- anova(lm(y ~ g, d)); k <- kruskal.test(y ~ factor(g), d)
pairs <- combn(c("a", "b", "c"), 2)
games <- apply(pairs, 2, function(p) {
  x <- d$y[d$g == p[1]]; z <- d$y[d$g == p[2]]; t <- t.test(x, z)
  c(t = unname(t$statistic), df = unname(t$parameter),
    p = ptukey(abs(t$statistic) * sqrt(2), 3, t$parameter, lower.tail = FALSE)[[1]])
})
ranks <- rank(d$y); N <- nrow(d); ties <- table(ranks)
spread <- N * (N + 1) / 12 - sum(ties^3 - ties) / (12 * (N - 1))  # Dunn (1964)
dunn <- apply(pairs, 2, function(p) {
  i <- d$g == p[1]; j <- d$g == p[2]
  (mean(ranks[i]) - mean(ranks[j])) / sqrt(spread * (1 / sum(i) + 1 / sum(j)))
})
tukey <- TukeyHSD(aov(y ~ g, d))$g
write_case("named_three_groups", "5, 9 and 16 people with SD 3, 2 and 0.6", d, list(
  asked("anova", "Between-subject ANOVA", "anova(lm(y ~ g))", list(row = list(F = a$F[1], df1 = a$Df[1],
    df2 = a$Df[2], p = a$P[1])), between = I("g")),
  asked("anova", "Between-subject ANOVA", "TukeyHSD(aov(y ~ g))", list(contrasts = list(
    p_adjusted = as.numeric(tukey[, "p adj"]))), between = I("g"), always_posthoc = TRUE, abs = 1e-6),
  asked("welch", "Welch's ANOVA", "oneway.test(y ~ g)", list(row = list(F = unname(w$statistic),
    df1 = w$parameter[[1]], df2 = w$parameter[[2]], p = w$p.value)), between = I("g")),
  asked("welch", "Welch's ANOVA", "Games-Howell: t.test of each pair, ptukey(|t| sqrt 2, 3, df)",
    list(contrasts = list(t = games["t", ], df = games["df", ], p_adjusted = games["p", ])),
    between = I("g"), always_posthoc = TRUE, abs = 1e-6),
  asked("kruskal", "Kruskal-Wallis test", "kruskal.test(y ~ g)", list(row = list(
    H = unname(k$statistic), df = unname(k$parameter), p = k$p.value)), between = I("g")),
  asked("kruskal", "Kruskal-Wallis test", "Dunn (1964) by formula; p.adjust('holm')", list(
    contrasts = list(z = dunn, p_adjusted = p.adjust(2 * pnorm(-abs(dunn)), "holm"))),
    between = I("g"), always_posthoc = TRUE)))

# ---- ratings with ties ----
d <- data.frame(g = rep(c("few", "many"), c(7, 12)),
  y = c(sample(1:7, 7, TRUE, c(1, 1, 1, 2, 3, 4, 4)), sample(1:7, 12, TRUE, c(4, 4, 3, 2, 1, 1, 1))))
exact <- wilcox_test(y ~ factor(g), d, distribution = "exact")
write_case("named_ratings", "7 and 12 people rate from 1 to 7", d, list(
  asked("mannwhitney", "Mann-Whitney test", "coin::wilcox_test(y ~ g, distribution = 'exact')", list(
    row = list(z = as.numeric(statistic(exact)), p = as.numeric(pvalue(exact)))), between = I("g"))))

# ---- three conditions of the same people, and two measures ----
n <- 9
wide <- data.frame(p = round(rnorm(n, 0, 1), 2), q = round(rnorm(n, 0.8, 2), 2), r = round(rnorm(n, 1.2, 0.4), 2))
d <- data.frame(s = rep(seq_len(n), 3), cond = rep(names(wide), each = n), y = unlist(wide, use.names = FALSE))
two <- d[d$cond != "r", ]
t2 <- t.test(wide$p, wide$q, paired = TRUE); v <- wilcox.test(wide$p, wide$q, paired = TRUE)
write_case("named_two_conditions", "9 people, two conditions", two, list(
  asked("t", "Paired t test", "t.test(paired = TRUE)", list(row = list(t = unname(t2$statistic),
    df = unname(t2$parameter), p = t2$p.value, ci_low = t2$conf.int[1], ci_high = t2$conf.int[2])),
    within = I("cond"), subject = "s"),
  asked("wilcoxon", "Wilcoxon signed-rank test", "wilcox.test(paired = TRUE)", list(row = list(
    V = unname(v$statistic), p = v$p.value)), within = I("cond"), subject = "s")))
m <- lm(as.matrix(wide) ~ 1)
s <- summary(Anova(m, idata = data.frame(cond = factor(names(wide))), idesign = ~cond, type = 3), multivariate = FALSE)
u <- s$univariate.tests["cond", ]; e <- s$pval.adjustments["cond", ]
f <- friedman.test(as.matrix(wide))
rm_row <- function(p) list(F = u[["F value"]], df1 = u[["num Df"]], df2 = u[["den Df"]], p_used = p)
write_case("named_three_conditions", "9 people, three conditions of different spread", d, list(
  asked("rm", "Repeated-measures ANOVA", "car::Anova(idesign = ~ cond)", list(row = rm_row(u[["Pr(>F)"]])),
    within = I("cond"), subject = "s", correction = "none"),
  asked("rm", "Repeated-measures ANOVA", "car::Anova(idesign = ~ cond), GG",
    list(row = rm_row(e[["Pr(>F[GG])"]])), within = I("cond"), subject = "s", correction = "gg"),
  asked("rm", "Repeated-measures ANOVA", "car::Anova(idesign = ~ cond), HF",
    list(row = rm_row(e[["Pr(>F[HF])"]])), within = I("cond"), subject = "s", correction = "hf"),
  asked("friedman", "Friedman's test", "friedman.test", list(row = list(chi2 = unname(f$statistic),
    df = unname(f$parameter), p = f$p.value)), within = I("cond"), subject = "s")))
one <- t.test(wide$p, mu = 0.5); w1 <- shapiro.test(wide$q)
names(wide) <- c("y", "x", "z")
rs <- cor.test(wide$x, wide$y, method = "spearman"); r <- cor.test(wide$x, wide$y)
write_case("named_columns", "9 people, two measures", wide, list(
  asked("t", "One-sample t test", "t.test(mu = 0.5)", list(row = list(t = unname(one$statistic),
    df = unname(one$parameter), p = one$p.value)), mu = 0.5),
  asked("spearman", "Spearman's rank correlation", "cor.test(method = 'spearman')", list(row = list(
    r = unname(rs$estimate), p = rs$p.value)), partner = "x"),
  asked("pearson", "Pearson's correlation", "cor.test()", list(row = list(r = unname(r$estimate),
    p = r$p.value)), partner = "x")))
