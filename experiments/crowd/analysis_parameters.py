"""Every threshold of the crowd study's analysis, with the place it comes from."""

from dataclasses import dataclass
from typing import Final

from lab.errors import UsageError


@dataclass(frozen=True)
class AnalysisParameters:
    """Thresholds of exclusion and testing; all of them appear in the report.

    `alpha`, the decision by Shapiro-Wilk, Bonferroni post-hocs and `n_splits` are those of the
    source. The rest is this platform's: a walk is out when more than `max_lost_01` of it was not
    tracked or when the participant did not come back; a person when less than the share
    `min_walks_01` of the walks of a block remains. `dice_bound` and `path_bound_01` are the
    differences of paths that are still called equal (about one standard deviation between
    configurations in the source, and a twentieth of the path). `narrow_gap_m` is the widest gap
    of two people's centres that `shoulders_to_gap_narrow_deg` counts.
    """

    alpha: float = 0.05
    normality_alpha: float = 0.05
    max_lost_01: float = 0.10
    min_walks_01: float = 0.5
    n_splits: int = 30
    n_permutations: int = 999
    dice_bound: float = 0.05
    path_bound_01: float = 0.05
    splits_seed: int = 20200
    narrow_gap_m: float = 1.5

    def __post_init__(self) -> None:
        for name in ("alpha", "normality_alpha", "dice_bound", "path_bound_01"):
            if not 0 < getattr(self, name) < 1:
                raise UsageError(f"{name} is {getattr(self, name)}; give a number between 0 and 1")
        for name in ("max_lost_01", "min_walks_01"):
            if not 0 <= getattr(self, name) <= 1:
                raise UsageError(f"{name} is {getattr(self, name)}; give a share from 0 to 1")
        if not 0 < self.narrow_gap_m < float("inf"):
            raise UsageError(
                f"narrow_gap_m is {self.narrow_gap_m}; give a number of metres above 0"
            )
        for name in ("n_splits", "n_permutations"):
            if getattr(self, name) < 1:
                raise UsageError(f"{name} is {getattr(self, name)}; give a whole number above 0")


DEFAULT_PARAMETERS: Final = AnalysisParameters()
