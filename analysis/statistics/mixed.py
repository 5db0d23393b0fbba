"""Mixed models of cells by REML with Kenward-Roger or Satterthwaite degrees of freedom."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np
from scipy import special

from visavis.analysis.statistics.anova import Anova, AnovaEffect
from visavis.analysis.statistics.design import Codes, Design, Frame, Levels, read_design
from visavis.analysis.statistics.effects import Tails, partial_eta_squared, tails_of
from visavis.analysis.statistics.errors import ConstantResponse, NotConverged, UnknownMethod
from visavis.analysis.statistics.kenward_roger import kenward_roger_covariance, kenward_roger_df
from visavis.analysis.statistics.linear import model_matrix
from visavis.analysis.statistics.random_effects import LinearMixedModel, fit_components, slope_terms
from visavis.analysis.statistics.reml import MAX_LOG_RATIO, Moments, group_sums
from visavis.analysis.statistics.results import Array, Provenance

Ddf: TypeAlias = Literal["kenward-roger", "satterthwaite"]
RandomPart: TypeAlias = Literal["slopes", "intercept"]
"""Random part: people differ in every within effect, or in level alone (one pooled error)."""

SINGULAR_SD_RATIO = 1e-4
"""Ratio of the intercepts' SD to the residual SD below which a fit is called singular."""


@dataclass(frozen=True)
class RandomIntercept:
    """A fitted model y = Xβ + one random intercept per group + noise.

    Variances are `between` (intercepts) and `residual`; `is_singular` says that the former is
    zero. `cov` is the plain covariance of β (p, p); `ddf` says how its tests find their df.
    """

    X: Array
    y: Array
    groups: Codes
    ratio: float
    residual: float
    beta: Array
    cov: Array
    ddf: Ddf = "kenward-roger"

    @property
    def between(self) -> float:
        """Variance of the random intercepts."""
        return self.ratio * self.residual

    @property
    def total_sd(self) -> float:
        """SD of a single response from all sources, people and residual together."""
        return float(np.sqrt(self.between + self.residual))

    @property
    def is_singular(self) -> bool:
        """Tell whether the intercepts have no variance left (lme4's limit of the SD ratio)."""
        return self.ratio < SINGULAR_SD_RATIO**2

    @cached_property
    def _sums(self) -> tuple[Array, Array]:
        return group_sums(self.X, self.groups)

    @cached_property
    def _kenward_roger(self) -> tuple[Array, list[Array], Array]:
        """Return Kenward-Roger's covariance of β, the P matrices and the covariance W."""
        S, sizes = self._sums
        cov = self.cov
        V_inverse_X_scaled = (
            self.X - (self.ratio / (1 + self.ratio * sizes))[self.groups, None] * S[self.groups]
        )
        A = V_inverse_X_scaled / self.residual  # V⁻¹X
        sums = group_sums(A, self.groups)[0]  # Z'V⁻¹X
        d = sizes / (1 + self.ratio * sizes) / self.residual  # diagonal of Z'V⁻¹Z
        vinv_A = (
            A - (self.ratio / (1 + self.ratio * sizes))[self.groups, None] * sums[self.groups]
        ) / self.residual
        P = [-sums.T @ sums, -A.T @ A]
        vinv_sums = group_sums(vinv_A, self.groups)[0]
        Q = [
            [sums.T @ (d[:, None] * sums), sums.T @ vinv_sums],
            [vinv_sums.T @ sums, A.T @ vinv_A],
        ]
        n = self.y.size
        c = self.ratio / (1 + self.ratio * sizes)
        trace = np.array(
            [
                [(d**2).sum(), (d / (1 + self.ratio * sizes)).sum() / self.residual],
                [0.0, (n - (2 * c * sizes - (c * sizes) ** 2).sum()) / self.residual**2],
            ]
        )
        trace[1, 0] = trace[0, 1]
        information = np.empty((2, 2))
        for i in range(2):
            for j in range(2):
                information[i, j] = (
                    trace[i, j]
                    - 2 * float((cov * Q[i][j]).sum())
                    + float(((cov @ P[i]) * (cov @ P[j]).T).sum())
                )
        W: Array = np.asarray(2 * np.linalg.inv(information), dtype=np.float64)
        return kenward_roger_covariance(cov, P, Q, W), P, W

    @property
    def covariance(self) -> Array:
        """The covariance of β used with these degrees of freedom."""
        return self._kenward_roger[0] if self.ddf == "kenward-roger" else self.cov

    def test(self, L: Array) -> tuple[float, float]:
        """Return F and denominator df of the hypothesis Lβ = 0; L has full row rank (q, p)."""
        estimate = L @ self.beta
        q = L.shape[0]
        F = float(estimate @ np.linalg.solve(L @ self.covariance @ L.T, estimate)) / q
        if self.ddf == "kenward-roger":
            _, P, W = self._kenward_roger
            df, scale = kenward_roger_df(L, self.cov, P, W)
            return F * scale, df
        return F, self._satterthwaite(L)

    @cached_property
    def _variance_of_parameters(self) -> tuple[Array, list[Array]]:
        """Return the covariance of (SD ratio, residual SD) and the derivatives of cov of β.

        From the curvature of −2 log REML, by central differences; directions without curvature
        are left out, as lmerTest does for singular fits.
        """
        at = np.array([np.sqrt(self.ratio), np.sqrt(self.residual)])
        steps = 1e-3 * np.array([max(at[0], 0.1), at[1]])

        moments = Moments(self.X, self.y - self.y.mean(), self.groups)

        def deviance(offset: Array) -> float:
            sd_ratio, sd = at + offset * steps
            return moments.deviance(float(sd_ratio), float(sd))

        unit = np.eye(2)
        hessian = np.empty((2, 2))
        for i in range(2):
            for j in range(2):
                if i == j:
                    e = unit[i]
                    f = [deviance(m * e) for m in (-2, -1, 0, 1, 2)]
                    second = -f[0] + 16 * f[1] - 30 * f[2] + 16 * f[3] - f[4]
                    hessian[i, i] = second / (12 * steps[i] ** 2)
                else:
                    total = 0.0
                    for m, weight in ((1, 4 / 3), (2, -1 / 12)):
                        for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
                            total += weight * a * b * deviance(m * (a * unit[i] + b * unit[j]))
                    hessian[i, j] = total / (4 * steps[i] * steps[j])
        values, vectors = np.linalg.eigh((hessian + hessian.T) / 2)
        has_curvature = values > 1e-8
        covariance = (
            2 * (vectors[:, has_curvature] / values[has_curvature]) @ vectors[:, has_curvature].T
        )
        slopes = []
        for i in range(2):
            total_cov = np.zeros_like(self.cov)
            for m, weight in ((1, 8.0), (-1, -8.0), (2, -1.0), (-2, 1.0)):
                sd_ratio, sd = at + m * unit[i] * steps
                total_cov += weight * moments.covariance(float(sd_ratio**2), float(sd**2))
            slopes.append(total_cov / (12 * steps[i]))
        return covariance, slopes

    def _satterthwaite(self, L: Array) -> float:
        values, vectors = np.linalg.eigh(L @ self.cov @ L.T)
        rows = vectors.T @ L
        covariance, slopes = self._variance_of_parameters
        dfs = []
        for value, row in zip(values, rows, strict=True):
            gradient = np.array([row @ slope @ row for slope in slopes])
            dfs.append(2 * value**2 / float(gradient @ covariance @ gradient))
        if len(dfs) == 1 or np.ptp(dfs) < 1e-8:
            return float(np.mean(dfs))
        total = sum(df / (df - 2) for df in dfs if df > 2)
        q = len(dfs)
        return float(2 * total / (total - q)) if total > q else 2.0


def fit_random_intercept(
    X: Array, y: Array, groups: Codes, *, name: str = "y", ddf: Ddf = "kenward-roger"
) -> RandomIntercept:
    """Fit by REML; X (n, p) of full rank, groups (n,) codes of the random intercept."""
    if np.linalg.matrix_rank(X) < X.shape[1]:
        raise ConstantResponse(f"some cells of {name} are empty; the model cannot be estimated")
    centre = float(y.mean())  # keeps digits in the cross products; the intercept takes it back
    moments = Moments(X, y - centre, groups)
    ratio = moments.best_ratio()
    beta, rss, _ = moments.solve(ratio)
    beta[0] += centre
    residual = rss / (y.size - X.shape[1])
    if residual <= 1e-20 * float(y.var()) or np.log(ratio or 1.0) > MAX_LOG_RATIO - 0.5:
        raise ConstantResponse(
            f"{name} does not vary within subjects beyond the effects; F is not defined"
        )
    cov = moments.covariance(ratio, residual)
    return RandomIntercept(X, y, groups, ratio, residual, beta, cov, ddf)


def fit_mixed(
    design: Design, y: Array, *, random: RandomPart = "slopes", ddf: Ddf = "kenward-roger"
) -> tuple[LinearMixedModel | RandomIntercept, str]:
    """Fit the fixed effects of a design and return the model with the words for its error.

    "slopes" lets people differ in every within effect (`fit_components`); where that cannot be
    fitted the random intercept alone is, and the words say so. Satterthwaite's df need "intercept".
    """
    X, _ = design_matrix(design)
    words = "random intercept"
    if random == "slopes":
        if ddf != "kenward-roger":
            raise UnknownMethod("random slopes have Kenward-Roger df; take a random intercept")
        try:
            return fit_components(design, X, y), slopes_text(design)
        except NotConverged:
            words = "random intercept, for random slopes did not converge"
    fit = fit_random_intercept(X, y, design.subject, name=design.dv, ddf=ddf)
    return fit, words + (", singular" if fit.is_singular else "")


def slopes_text(design: Design) -> str:
    """Return what varies from person to person, in words."""
    effect_names = " and ".join(" × ".join(t) for t in slope_terms(design))
    return f"random intercept and effects of {effect_names}" if effect_names else "random intercept"


def mixed_anova(
    frame: Frame,
    dv: str,
    *,
    subject: str,
    within: Sequence[str],
    between: Sequence[str] = (),
    levels: Levels | None = None,
    ddf: Ddf = "kenward-roger",
    random: RandomPart = "slopes",
) -> Anova:
    """Test all effects (type III) by a mixed model of cells; subjects may lack some.

    People may differ in every within effect ("slopes"), so that complete data give the
    repeated-measures ANOVA; "intercept" pools all of them into one error, which gives too many
    significant results where people do differ.
    """
    design = read_design(
        frame, dv, subject=subject, within=within, between=between, levels=levels, missing="mixed"
    )
    name = "Kenward-Roger" if ddf == "kenward-roger" else "Satterthwaite"
    _, place = design_matrix(design)
    fit, error_term = fit_mixed(design, design.y, random=random, ddf=ddf)
    return Anova(
        tuple(_effects_of_fit(fit, place, error_term, _tails(design, design.y))),
        design,
        Provenance(
            "Mixed model ANOVA (type III)",
            design.n,
            error_term=f"{error_term} per subject, REML, {name} df",
            dropped=design.dropped,
            notes=tuple(fit.negative_variance_notes(subject))
            if isinstance(fit, LinearMixedModel)
            else (),
        ),
        subject,
        fit,
    )


def design_matrix(design: Design) -> tuple[Array, dict[tuple[str, ...], slice]]:
    """Return the sum-coded fixed effects of a design and the columns of every term."""
    X, place = model_matrix(
        [f.codes for f in design.factors], [f.k for f in design.factors], design.y.size
    )
    names = [f.name for f in design.factors]
    return X, {tuple(names[i] for i in term): columns for term, columns in place.items()}


def level_rows(design: Design, names: Sequence[str]) -> Array:
    """Return the model row of every cell of some factors, averaged over the others' levels."""
    k = [f.k for f in design.factors]
    cells = np.stack(np.unravel_index(np.arange(int(np.prod(k))), tuple(k)))
    X, _ = model_matrix(list(cells), k, cells.shape[1])
    positions = [i for i, f in enumerate(design.factors) if f.name in names]
    code = np.ravel_multi_index(tuple(cells[i] for i in positions), tuple(k[i] for i in positions))
    count = int(np.prod([k[i] for i in positions]))
    return np.stack([X[code == c].mean(axis=0) for c in range(count)])


def contrast_effect(
    fit: LinearMixedModel | RandomIntercept,
    term: tuple[str, ...],
    L: Array,
    error_term: str,
    *,
    tails: Tails,
) -> AnovaEffect:
    """Return a term's F test, that Lβ = 0 in the fitted model; L has full row rank (q, p).

    `tails` are those of the responses around the means of their cells.
    """
    F, df = fit.test(L)
    q = L.shape[0]
    p = float(special.fdtrc(q, df, F))
    return AnovaEffect(
        term=term,
        F=F,
        df1=q,
        df2=df,
        p=p,
        ss=None,
        ss_error=None,
        error_term=error_term,
        eta=partial_eta_squared(F, q, df, tails=tails),
        ges=None,
        sphericity=None,
        correction="none",
        df1_used=q,
        df2_used=df,
        p_used=p,
    )


def mixed_effects(
    design: Design,
    y: Array,
    *,
    ddf: Ddf = "kenward-roger",
    random: RandomPart = "slopes",
    only: Sequence[str] | None = None,
) -> Iterator[AnovaEffect]:
    """Return type III tests of a response, one value per row of the design."""
    _, place = design_matrix(design)
    fit, error = fit_mixed(design, y, random=random, ddf=ddf)
    terms = place if only is None else {tuple(only): place[tuple(only)]}
    return _effects_of_fit(fit, terms, error, _tails(design, y))


def _tails(design: Design, y: Array) -> Tails:
    return tails_of(design.around_cell_means(y), people=design.n)


def _effects_of_fit(
    fit: LinearMixedModel | RandomIntercept,
    place: Mapping[tuple[str, ...], slice],
    error: str,
    tails: Tails,
) -> Iterator[AnovaEffect]:
    identity = np.eye(fit.beta.size)
    for term, columns in place.items():
        if term:
            yield contrast_effect(fit, term, identity[columns], error, tails=tails)
