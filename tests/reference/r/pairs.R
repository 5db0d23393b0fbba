# Reference results of Bradley–Terry models; run from the repository root:
#   Rscript tests/reference/r/pairs.R
# Writes tests/reference/stats/bradley_terry_*.json. Without ties the model is fitted by
# BradleyTerry2 (glm), on its own example data and on made ones; with ties by maximising the
# likelihood of Davidson (1970) with optim. Robust covariances are computed from the scores. People
# with abilities of their own, without ties, by lme4's glmer (Laplace).
suppressMessages({library(BradleyTerry2); library(lme4); library(jsonlite)})
packages <- c("BradleyTerry2", "lme4")
software <- list(R = paste(R.version$major, R.version$minor, sep = "."),
  packages = setNames(lapply(packages, function(p) as.character(packageVersion(p))), packages))
write_case <- function(id, title, data, design, results) {
  file <- list(schema = "vr-stats-reference/1", id = id, title = title,
    origin = "tests/reference/r/pairs.R", design = design,
    data = list(n_rows = nrow(data), levels = setNames(list(), character(0)),
      columns = lapply(data, function(v) if (is.factor(v)) as.character(v) else v)),
    software = software, results = results)
  write_json(file, file.path("tests/reference/stats", paste0(id, ".json")), auto_unbox = TRUE,
    digits = 12, na = "null")
}
design <- list(subject = "s", first = "first", second = "second")
tight <- list(rel = 1e-6, abs = 1e-7)

# Counts of choices; the comparison takes each for that of another person.
tallied <- function(first, second, won, lost) {
  d <- data.frame(first = rep(first, 2), second = rep(second, 2),
    y = rep(c(1, -1), each = length(won)), count = c(won, lost))
  d[d$count > 0, ]
}

# Sum of scores by person, as HC0 sandwich times n / (n - 1), of a binomial glm of single choices.
clustered <- function(m, s) {
  X <- model.matrix(m); y <- m$y; u <- X * (y - fitted(m))
  u <- rowsum(u, s); V <- vcov(m); n <- nrow(u)
  V %*% (t(u) %*% u) %*% V * n / (n - 1)
}
wald <- function(b, V, n) {
  q <- length(b); df2 <- n - 1 - q + 1
  F <- c(t(b) %*% solve(V, b)) * df2 / ((n - 1) * q)
  list(F = F, df1 = q, df2 = df2, p = pf(F, q, df2, lower.tail = FALSE))
}

# Citations between journals (Stigler 1994; Agresti 2002), one row and one person per citation.
data(citations); counts <- countsToBinomial(citations)
b <- BTm(cbind(win1, win2), player1, player2, data = counts)
long <- tallied(counts$player1, counts$player2, counts$win1, counts$win2)
items <- levels(counts$player1)
write_case("bradley_terry_citations", "Citations between four journals", long, design, list(list(
  procedure = "bradley_terry", dv = "y", call = "BTm(cbind(win1, win2), player1, player2)",
  items = items,
  expected = list(coefficients = unname(coef(b)), se = unname(sqrt(diag(vcov(b)))),
    fit_chi2 = deviance(b), fit_df = df.residual(b)), tolerance = tight)))

# Baseball with the home team's advantage.
data(baseball)
m <- baseball
m$home.team <- data.frame(team = m$home.team, at.home = 1)
m$away.team <- data.frame(team = m$away.team, at.home = 0)
b <- BTm(cbind(home.wins, away.wins), home.team, away.team, data = m, formula = ~ team + at.home,
  id = "team")
long <- tallied(baseball$home.team, baseball$away.team, baseball$home.wins, baseball$away.wins)
write_case("bradley_terry_baseball", "Baseball with the advantage of the home team", long, design,
  list(list(procedure = "bradley_terry", dv = "y", side = TRUE, items = levels(baseball$home.team),
    call = "BTm(cbind(home.wins, away.wins), home.team, away.team, formula = ~ team + at.home)",
    expected = list(coefficients = unname(coef(b)), se = unname(sqrt(diag(vcov(b))))),
    tolerance = tight)))

# People who differ in what they like: choices among four items, robust errors.
set.seed(20268)
items <- c("a", "b", "c", "d"); n <- 22
d <- do.call(rbind, lapply(seq_len(n), function(i) {
  likes <- c(0, 0.3, 0.6, 1.1) + rnorm(4, 0, 0.8)
  p <- rbind(t(combn(4, 2)), t(combn(4, 2))[, 2:1])
  u <- likes[p[, 1]] - likes[p[, 2]] + rlogis(nrow(p)) + 0.2
  data.frame(s = sprintf("S%02d", i), first = items[p[, 1]], second = items[p[, 2]], u = u)
}))
d$y <- ifelse(d$u > 0, 1, -1)
X <- sapply(items[-1], function(v) (d$first == v) - (d$second == v))
m <- glm((d$y > 0) ~ X - 1, family = binomial, control = glm.control(epsilon = 1e-14))
V <- clustered(m, d$s); none <- glm((d$y > 0) ~ 0, family = binomial)
chi2 <- deviance(none) - deviance(m)
plain <- list(procedure = "bradley_terry", dv = "y", items = items, call =
  "glm(y > 0 ~ X - 1, binomial); covariance from scores summed by person, times n / (n - 1)",
  expected = list(coefficients = unname(coef(m)), se = unname(sqrt(diag(vcov(m)))),
    robust_se = unname(sqrt(diag(V))), test = wald(coef(m), V, n),
    chi2 = chi2, chi2_p = pchisq(chi2, 3, lower.tail = FALSE),
    log_likelihood = c(logLik(m))), tolerance = tight)
m <- glm((d$y > 0) ~ X + 1, family = binomial, control = glm.control(epsilon = 1e-14))
V <- clustered(m, d$s)[c(2:4, 1), c(2:4, 1)]
sided <- list(procedure = "bradley_terry", dv = "y", items = items, side = TRUE,
  call = "glm(y > 0 ~ X, binomial), the constant for the first place",
  expected = list(coefficients = unname(coef(m)[c(2:4, 1)]), robust_se = unname(sqrt(diag(V))),
    test = wald(coef(m)[2:4], V[1:3, 1:3], n)), tolerance = tight)

# People whose abilities differ, with all covariances, by Laplace's approximation.
g <- data.frame(w = as.integer(d$y > 0), s = d$s, X)
tight_glmer <- glmerControl(optimizer = "bobyqa", tolPwrss = 1e-12, check.conv.singular = "ignore",
  optCtrl = list(maxfun = 1e6, rhoend = 1e-9))
m <- glmer(w ~ 0 + b + c + d + (0 + b + c + d | s), g, binomial, control = tight_glmer)
none <- glmer(w ~ 0 + (0 + b + c + d | s), g, binomial, control = tight_glmer)
chi2 <- 2 * (c(logLik(m)) - c(logLik(none)))
own <- list(procedure = "bradley_terry", dv = "y", items = items, random = "maximal",
  call = "lme4::glmer(y > 0 ~ 0 + X + (0 + X | s), binomial)",
  expected = list(coefficients = unname(fixef(m)), se = unname(sqrt(diag(as.matrix(vcov(m))))),
    spread = unname(matrix(VarCorr(m)$s, 3)), log_likelihood = c(logLik(m)), chi2 = chi2,
    chi2_p = pchisq(chi2, 3, lower.tail = FALSE)), tolerance = list(rel = 1e-3, abs = 1e-3))

# Ties, by Davidson's likelihood.
d$tied <- ifelse(abs(d$u) < 0.5, 0, d$y)
davidson <- function(X, y) {
  parts <- function(t) {
    h <- c(X %*% t[seq_len(ncol(X))]) / 2; e <- t[ncol(X) + 1]
    s <- log(exp(h) + exp(-h) + exp(e)); list(h = h, e = e, s = s)
  }
  loss <- function(t) with(parts(t), -sum(ifelse(y > 0, h, ifelse(y < 0, -h, e)) - s))
  rows <- function(t) with(parts(t), {
    p1 <- exp(h - s); p2 <- exp(-h - s); p0 <- exp(e - s)
    cbind(X * (y - p1 + p2) / 2, (y == 0) - p0)
  })
  slope <- function(t) -colSums(rows(t))
  t <- optim(rep(0, ncol(X) + 1), loss, slope, method = "BFGS", control = list(reltol = 1e-16))$par
  for (i in 1:4) { H <- optimHess(t, loss, slope); t <- t - solve(H, slope(t)) }
  H <- sapply(seq_along(t), function(i) {
    h <- replace(0 * t, i, 1e-5); (slope(t + h) - slope(t - h)) / 2e-5 })
  list(par = t, V = solve((H + t(H)) / 2), rows = rows(t), loss = loss(t))
}
f <- davidson(X, d$tied); u <- rowsum(f$rows, d$s); V <- f$V %*% (t(u) %*% u) %*% f$V * n / (n - 1)
none <- davidson(matrix(0, nrow(X), 0), d$tied)
chi2 <- 2 * (none$loss - f$loss)
ties <- list(procedure = "bradley_terry", dv = "tied", items = items,
  call = "optim of Davidson's likelihood", expected = list(coefficients = f$par,
    se = sqrt(diag(f$V)), robust_se = sqrt(diag(V)), test = wald(f$par[1:3], V[1:3, 1:3], n),
    chi2 = chi2, chi2_p = pchisq(chi2, 3, lower.tail = FALSE), log_likelihood = -f$loss),
  tolerance = list(rel = 1e-5, abs = 1e-6))
write_case("bradley_terry_people", "22 people, 12 choices each among four items",
  d[c("s", "first", "second", "y", "tied")], design, list(plain, sided, ties, own))
