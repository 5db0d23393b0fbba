"""The 41 pairs of adjectives by their names here, and where the source put those it kept.

A name says both ends, the low one first (`slow_fast`); words for people stand in the text files.
"""

from typing import Final

PAIRS: Final = (
    "slow_fast", "hard_soft", "quiet_noisy", "blunt_sharp", "edgy_round", "unpleasant_pleasant",
    "dirty_clean", "bumpy_smooth", "dark_bright", "ugly_cute", "coarse_fine", "heavy_light",
    "unstable_stable", "unafraid_afraid", "closed_open", "vague_distinct", "ugly_beautiful",
    "tight_free", "drab_clear", "lonely_bustling", "narrow_wide", "mild_violent", "dull_quick",
    "angular_circular", "dormant_brisk", "weak_strong", "inelastic_elastic", "sad_happy",
    "uncool_cool", "thin_thick", "simple_gaudy", "old_young", "strained_relaxed", "small_large",
    "artificial_natural", "adult_childish", "narrow_broad", "poor_rich", "dim_sharp",
    "gloomy_cheerful", "calm_excited",
)  # fmt: skip
FACTORS: Final = ("quickness", "clearness", "activeness", "largeness")
"""The four primary parameters, as the source calls its clusters."""
PRINTED: Final[dict[str, dict[str, tuple[str, ...]]]] = {
    "A": {
        "quickness": ("slow_fast", "dull_quick", "blunt_sharp"),
        "clearness": (
            "weak_strong", "dirty_clean", "uncool_cool", "ugly_cute", "old_young",
            "unstable_stable", "artificial_natural", "vague_distinct", "poor_rich", "drab_clear",
        ),
        "activeness": (
            "calm_excited", "mild_violent", "quiet_noisy", "dormant_brisk", "unpleasant_pleasant",
            "sad_happy", "dark_bright", "simple_gaudy",
        ),
        "largeness": (
            "heavy_light", "small_large", "closed_open", "narrow_broad", "tight_free",
            "gloomy_cheerful",
        ),
    },
    "B": {
        "quickness": ("slow_fast", "dull_quick"),
        "clearness": (
            "drab_clear", "ugly_beautiful", "bumpy_smooth", "uncool_cool", "unstable_stable",
            "ugly_cute",
        ),
        "activeness": (
            "artificial_natural", "simple_gaudy", "closed_open", "lonely_bustling", "sad_happy",
            "old_young", "dim_sharp", "dark_bright", "gloomy_cheerful", "unpleasant_pleasant",
        ),
        "largeness": (
            "poor_rich", "dormant_brisk", "heavy_light", "small_large", "narrow_wide",
            "blunt_sharp", "adult_childish", "calm_excited", "quiet_noisy", "mild_violent",
            "edgy_round",
        ),
    },
}  # fmt: skip
"""The pairs kept and their clusters, as tables 2 and 3 print them; the rows of table 2 where the
name of the third cluster is lost are read as its.
"""


def printed_cluster(pair: str, motions: str) -> str:
    """Return the cluster in which a pair is printed for set A or B; "" where it was left out."""
    return next((c for c, pairs in PRINTED[motions].items() if pair in pairs), "")
