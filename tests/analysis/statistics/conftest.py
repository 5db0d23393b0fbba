"""What tests of statistics share."""

import pytest

from visavis.analysis.statistics import effects


@pytest.fixture
def normal_tails(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take values for normal, so that intervals are the textbook's and not widened."""
    for name in ("LONG_TAILS_EXPECTED", "KURTOSIS_UNSEEN", "SKEWNESS_UNSEEN", "JACKKNIFE_SHORT"):
        monkeypatch.setattr(effects, name, 0.0)
