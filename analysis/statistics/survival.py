"""Times until something happens, some of them cut off before: Kaplan–Meier, log-rank, Cox.

A time is censored where watching ended before the event. Estimates are statsmodels'; what it is
given, and what becomes of data that it cannot estimate from, is checked here.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import special

from visavis.analysis.statistics.errors import ConstantResponse, StatisticsError
from visavis.analysis.statistics.inputs import numbers
from visavis.analysis.statistics.results import Array, number, p_text


@dataclass(frozen=True, eq=False)
class SurvivalTimes:
    """Times (n,) with whether the event came (n,), and the labels of group, stratum and cluster."""

    times: Array
    came: npt.NDArray[np.bool_]
    group: npt.NDArray[np.str_]
    stratum: npt.NDArray[np.str_]
    cluster: npt.NDArray[np.str_]


def survival_times(
    times: npt.ArrayLike,
    came: npt.ArrayLike,
    group: npt.ArrayLike,
    stratum: npt.ArrayLike,
    cluster: npt.ArrayLike,
) -> SurvivalTimes:
    """Return checked times; `came` says of each whether the event came or watching ended.

    Raises:
        StatisticsError: lengths differ, a time is missing or negative, or there is one group.
    """
    own = numbers(times, name="times")
    labels = [np.asarray(x).astype(str) for x in (group, stratum, cluster)]
    happened = np.asarray(came, dtype=np.bool_)
    if any(len(x) != len(own) for x in (happened, *labels)):
        raise StatisticsError("times, events and labels are not equally many")
    if (own < 0).any():
        raise StatisticsError("a time until an event is negative; give times from its begin")
    if len(np.unique(labels[0])) < 2:
        raise StatisticsError("times of one group alone; there is nothing to compare")
    return SurvivalTimes(own, happened, *labels)


@dataclass(frozen=True, eq=False)
class KaplanMeier:
    """The share without event just after each time at which one came; `median` is NaN where more
    than half never had it.
    """

    times: Array
    share: Array
    median: float
    n: int
    events: int


def kaplan_meier(data: SurvivalTimes, group: str) -> KaplanMeier:
    """Return the estimate of Kaplan and Meier (1958) for one group."""
    from statsmodels.duration.survfunc import SurvfuncRight  # late: takes a second to import

    own = data.group == group
    times, came = data.times[own], data.came[own]
    if not came.any():
        return KaplanMeier(np.empty(0), np.empty(0), float("nan"), len(times), 0)
    fit = SurvfuncRight(times, came.astype(float))
    below = np.flatnonzero(fit.surv_prob <= 0.5)
    median = float(fit.surv_times[below[0]]) if below.size else float("nan")
    return KaplanMeier(
        np.asarray(fit.surv_times), np.asarray(fit.surv_prob), median, len(times), int(came.sum())
    )


@dataclass(frozen=True)
class LogRank:
    """The log-rank test of all groups, within strata; observations count as independent."""

    chi2: float
    df: int
    p: float

    def sentence(self) -> str:
        """Return the result as a sentence."""
        return f"χ²({self.df}) = {number(self.chi2)}, {p_text(self.p)}"


def log_rank(data: SurvivalTimes) -> LogRank:
    """Test whether times until the event differ between groups (Mantel 1966).

    Raises:
        ConstantResponse: the event never came.
    """
    if not data.came.any():
        raise ConstantResponse("the event never came; there are no times to compare")
    from statsmodels.duration.survfunc import survdiff  # late: takes a second to import

    groups, codes = np.unique(data.group, return_inverse=True)
    chi2, _ = survdiff(data.times, data.came.astype(float), codes, strata=data.stratum)
    df = len(groups) - 1
    return LogRank(float(chi2), df, float(special.chdtrc(df, chi2)))  # exact in the far tail, too


@dataclass(frozen=True)
class HazardRatio:
    """How much sooner the event comes in `group` than in `reference`: the ratio of hazards with its
    interval, and a test by standard errors that are robust to clusters.
    """

    group: str
    reference: str
    ratio: float
    low: float
    high: float
    z: float
    p: float


def cox(data: SurvivalTimes, reference: str, level: float = 0.95) -> tuple[HazardRatio, ...]:
    """Return hazard ratios of every other group to `reference` (Cox 1972).

    Strata have hazards of their own; standard errors hold clusters together (Lin & Wei 1989). Ties
    are taken after Breslow, as statsmodels' robust errors are: R's `coxph` gives the same.

    Raises:
        StatisticsError: there is no such group.
        ConstantResponse: in some group the event never came, so that no ratio is finite.
    """
    groups = np.unique(data.group).tolist()
    if reference not in groups:
        raise StatisticsError(f"there is no group {reference!r}; there are {', '.join(groups)}")
    never = [g for g in groups if not data.came[data.group == g].any()]
    if never:
        raise ConstantResponse(
            f"the event never came in {', '.join(never)}; a ratio of hazards has no finite estimate"
        )
    from statsmodels.duration.hazard_regression import PHReg  # late: takes a second to import

    others = [str(g) for g in groups if g != reference]
    dummies = np.column_stack([data.group == g for g in others]).astype(float)
    strata = np.unique(data.stratum, return_inverse=True)[1]
    clusters = np.unique(data.cluster, return_inverse=True)[1]
    model = PHReg(data.times, dummies, data.came.astype(float), strata=strata, ties="breslow")
    fit = model.fit(groups=clusters)
    covariance = np.asarray(fit.cov_params())
    half = float(special.ndtri((1 + level) / 2))
    ratios = []
    for i, group in enumerate(others):
        estimate, se = float(fit.params[i]), float(np.sqrt(covariance[i, i]))
        z = estimate / se
        ratios.append(
            HazardRatio(
                group,
                reference,
                float(np.exp(estimate)),
                float(np.exp(estimate - half * se)),
                float(np.exp(estimate + half * se)),
                z,
                float(2 * special.ndtr(-abs(z))),
            )
        )
    return tuple(ratios)
