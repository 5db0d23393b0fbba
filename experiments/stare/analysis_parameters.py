"""Every threshold of the study's analysis, with the place it comes from."""

from dataclasses import dataclass

from lab.errors import UsageError
from visavis.pairs import TestRules


@dataclass(frozen=True)
class AnalysisParameters:
    """Thresholds of exclusion and testing; all of them appear in the report.

    `alpha`, the decision by Shapiro-Wilk and Bonferroni over each family are those of the source
    study. The exclusion limits are this platform's: a trial is out when more than
    `max_trial_lost_01` of it has no usable gaze, a participant when more than
    `max_bad_trials_01` of the trials are out or the mean calibration error exceeds
    `max_error_deg`. `minimum_participants` is what a paired test needs.
    """

    alpha: float = 0.05
    normality_alpha: float = 0.05
    interval_level: float = 0.95
    max_trial_lost_01: float = 0.30
    max_bad_trials_01: float = 0.30
    max_error_deg: float = 2.5
    minimum_participants: int = 3
    trials_per_condition: int = 18

    @property
    def tests(self) -> TestRules:
        """The thresholds of testing."""
        return TestRules(
            self.alpha, self.normality_alpha, self.interval_level, self.minimum_participants
        )

    def __post_init__(self) -> None:
        _ = self.tests  # which refuses what is out of range
        for name in ("max_trial_lost_01", "max_bad_trials_01"):
            if not 0 <= getattr(self, name) <= 1:
                raise UsageError(f"{name} is {getattr(self, name)}; give a share from 0 to 1")
        if self.max_error_deg <= 0:
            raise UsageError(f"max_error_deg is {self.max_error_deg}; give an angle above 0")


DEFAULT_PARAMETERS = AnalysisParameters()
