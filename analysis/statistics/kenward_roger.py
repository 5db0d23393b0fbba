"""Kenward and Roger's (1997) F test of a linear mixed model, from the pieces of its fit."""

from collections.abc import Sequence

import numpy as np

from visavis.analysis.statistics.results import Array


def kenward_roger_covariance(
    cov: Array, P: Sequence[Array], Q: Sequence[Sequence[Array]], W: Array
) -> Array:
    """Return the covariance of β widened for the uncertainty of the variance parameters.

    With V linear in its parameters and G_i their derivatives: `cov` = (X'V⁻¹X)⁻¹ of shape (p, p),
    P_i = −X'V⁻¹G_iV⁻¹X, Q_ij = X'V⁻¹G_iV⁻¹G_jV⁻¹X, `W` (r, r) the covariance of the parameters.
    """
    r = range(len(P))
    U = sum(W[i, j] * (Q[i][j] - P[i] @ cov @ P[j]) for i in r for j in r)
    return np.asarray(cov + cov @ (U + np.transpose(U)) @ cov, dtype=np.float64)


def kenward_roger_df(L: Array, cov: Array, P: Sequence[Array], W: Array) -> tuple[float, float]:
    """Return the denominator df of Lβ = 0, L of full row rank (q, p), and the scale of its F."""
    r = range(len(P))
    q = L.shape[0]
    theta = L.T @ np.linalg.solve(L @ cov @ L.T, L)
    parts = [theta @ cov @ P[i] @ cov for i in r]
    a1 = a2 = 0.0
    for i in r:
        for j in r:
            a1 += W[i, j] * float(np.trace(parts[i])) * float(np.trace(parts[j]))
            a2 += W[i, j] * float((parts[i] * parts[j].T).sum())
    b = (a1 + 6 * a2) / (2 * q)
    g = ((q + 1) * a1 - (q + 4) * a2) / ((q + 2) * a2)
    denominator = 3 * q + 2 * (1 - g)
    c1, c2, c3 = g / denominator, (q - g) / denominator, (q + 2 - g) / denominator
    mean = 1 / (1 - a2 / q)
    v0, v1, v2 = 1 + c1 * b, 1 - c2 * b, 1 - c3 * b
    if abs(v2) < 1e-10:
        v2 = 0.0
    spread = 2 / q * v0 / v1**2 / v2 if v2 else float("inf")
    rho = spread / (2 * mean**2)
    df = 4 + (q + 2) / (q * rho - 1) if np.isfinite(rho) else 4.0
    return float(df), float(df / (mean * (df - 2)))
