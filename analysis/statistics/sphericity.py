"""Sphericity: Mauchly's test, Greenhouse-Geisser and Huynh-Feldt."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import special

from visavis.analysis.statistics.results import Array, number, p_text


@dataclass(frozen=True)
class Sphericity:
    """How far the error of one within term is from spherical.

    `W` and `p` are Mauchly's; `p_r` is what R's `mauchly.test` and car print, where one factor of
    the series counts all cells instead of the contrasts. W and p are None where the error matrix
    is singular (too few subjects). `hf` may exceed 1; corrections use at most 1.
    """

    W: float | None
    p: float | None
    p_r: float | None
    gg: float
    hf: float
    p_gg: float
    p_hf: float

    @property
    def hf_used(self) -> float:
        """Huynh-Feldt epsilon, at most 1."""
        return min(1.0, self.hf)

    def __str__(self) -> str:
        mauchly = (
            "Mauchly's W not available (too few subjects)"
            if self.W is None or self.p is None
            else f"Mauchly's W = {number(self.W, 3)}, {p_text(self.p)}"
        )
        return f"{mauchly}, ε(GG) = {number(self.gg, 3)}, ε(HF) = {number(self.hf_used, 3)}"


def sphericity(errors: Array, df: int, F: float, df1: int, *, n_cells: int) -> Sphericity:
    """Judge the error contrasts of a term.

    `errors` are orthonormal contrast scores (n, q) centred within groups, q ≥ 2; `df` = subjects
    − groups; `df1` the term's numerator df; `n_cells` the cells of all within factors.
    """
    q = errors.shape[1]
    eigenvalues, gg, hf = _epsilons(errors, df)
    df2 = df * q
    hf_used = min(1.0, hf)
    W = p = p_r = None
    if df >= q and eigenvalues[0] > 1e-12 * eigenvalues[-1]:
        mean = sum(eigenvalues) / q
        W = math.exp(sum(math.log(value) for value in eigenvalues) - q * math.log(mean))
        p, p_r = _mauchly_p(W, q, df, q), _mauchly_p(W, q, df, n_cells)
    return Sphericity(
        W=W,
        p=p,
        p_r=p_r,
        gg=gg,
        hf=hf,
        p_gg=float(special.fdtrc(df1 * gg, df2 * gg, F)),
        p_hf=float(special.fdtrc(df1 * hf_used, df2 * hf_used, F)),
    )


def p_at_epsilon(errors: Array, df: int, F: float, df1: int, rule: Literal["gg", "hf"]) -> float:
    """Return p by Greenhouse-Geisser or Huynh-Feldt alone, as `sphericity` does."""
    _, gg, hf = _epsilons(errors, df)
    epsilon = gg if rule == "gg" else min(1.0, hf)
    return float(special.fdtrc(df1 * epsilon, df * errors.shape[1] * epsilon, F))


def _epsilons(errors: Array, df: int) -> tuple[list[float], float, float]:
    """Return the eigenvalues of the error's covariance, rising, as shares of the largest, and the
    epsilons of Greenhouse and Geisser and of Huynh and Feldt.
    """
    q = errors.shape[1]
    S = errors.T @ errors / df
    # A handful of numbers: Python's own arithmetic costs less than calls for arrays. They are
    # shares of the largest, because squares of small errors would be nothing.
    eigenvalues: list[float] = np.linalg.eigvalsh(S).tolist()
    if eigenvalues[-1] > 0:
        eigenvalues = [value / eigenvalues[-1] for value in eigenvalues]
    squares = q * sum(value**2 for value in eigenvalues)
    gg = sum(eigenvalues) ** 2 / squares if squares > 0 else math.nan
    hf = ((df + 1) * q * gg - 2) / (q * (df - q * gg)) if df > q * gg else float("inf")
    return eigenvalues, gg, hf


def _mauchly_p(W: float, q: int, df: int, series_q: int) -> float:
    if W <= 0:  # rounded to nothing, as where contrasts of many levels hardly differ from singular
        return 0.0
    rho = 1 - (2 * q**2 + q + 2) / (6 * q * df)
    z = -df * rho * math.log(W)
    f = q * (q + 1) / 2 - 1
    omega = (
        (q + 2)
        * (q - 1)
        * (q - 2)
        * (2 * q**3 + 6 * q**2 + 3 * series_q + 2)
        / (288 * (df * q * rho) ** 2)
    )
    first, second = float(special.chdtrc(f, z)), float(special.chdtrc(f + 4, z))
    return min(max(first + omega * (second - first), 0.0), 1.0)
