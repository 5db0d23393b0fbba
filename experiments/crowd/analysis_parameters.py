"""Every threshold of the crowd study's analysis, with the place it comes from."""

from dataclasses import dataclass
from typing import Final

from lab.errors import UsageError
from visavis.exclusions import Exclusion

RULES: Final = (
    Exclusion("max_lost_01", "trial", "lost_01", 0.10,
              "{value:.0%} of the walk not tracked (limit {limit:.0%})"),
    Exclusion("came_back", "trial", "came_back", 1.0,
              "did not come back to the mark in time", above=False),
    Exclusion("min_walks_01", "participant", "smallest_cell_01", 0.5,
              "{value:.0%} of the walks planned for a block can be used (limit {limit:.0%})",
              above=False),
)  # fmt: skip
"""What leaves out a walk, or a person; all of it this platform's."""


@dataclass(frozen=True)
class AnalysisParameters:
    """Thresholds of testing; all of them appear in the report.

    `alpha`, the decision by Shapiro-Wilk, Bonferroni post-hocs and `n_splits` are those of the
    source. The rest is this platform's. `dice_bound` and `path_bound_01` are the
    differences of paths that are still called equal (about one standard deviation between
    configurations in the source, and a twentieth of the path). `narrow_gap_m` is the widest gap
    of two people's centres that `shoulders_to_gap_narrow_deg` counts.
    """

    alpha: float = 0.05
    normality_alpha: float = 0.05
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
        if not 0 < self.narrow_gap_m < float("inf"):
            raise UsageError(
                f"narrow_gap_m is {self.narrow_gap_m}; give a number of metres above 0"
            )
        for name in ("n_splits", "n_permutations"):
            if getattr(self, name) < 1:
                raise UsageError(f"{name} is {getattr(self, name)}; give a whole number above 0")


DEFAULT_PARAMETERS: Final = AnalysisParameters()
