"""Each contrast has its own sentence, whether a test writes one for each or a text per family."""

import pytest

from tests.results.test_claims import rated
from tests.results.test_headlines import PLACE, analysed
from visavis import Compare


@pytest.mark.parametrize("how", [{"model": "clmm"}, {"test": "rm"}, {"test": "friedman"}])
def test_three_levels_have_three_contrasts_with_a_sentence_each(how: dict[str, str]) -> None:
    compare = Compare("liking", within="place", **how)  # type: ignore[arg-type]
    analysis, _ = analysed([PLACE], [compare], {"liking": rated})
    (finding,) = analysis.findings
    contrasts = finding.contrasts
    assert len(contrasts) == 3
    for contrast in contrasts:
        assert contrast.first in contrast.sentence
        assert contrast.second in contrast.sentence
        assert "\n" not in contrast.sentence
    assert len({c.sentence for c in contrasts}) == 3
