"""The p values of Wilcoxon's signed-rank tests that the source prints in section 6.2.

Its pairs are those of a person and a target: 13 a target, 65 over all.
"""

from typing import Final

ALL: Final = "all"
PAIRS: Final = (("adjectives", "features"), ("adjectives", "weights"), ("features", "weights"))
GUESS: Final = {
    ("adjectives", "features"): (0.382, 0.011, 0.807, 0.087, 0.007, 0.000),
    ("adjectives", "weights"): (0.133, 0.002, 0.019, 0.007, 0.004, 0.000),
    ("features", "weights"): (0.006, 0.002, 0.005, 0.003, 0.001, 0.000),
}
"""Distances after the guess: targets 1 to 5, and all of them."""
TIME: Final = {
    ("adjectives", "features"): (0.695, 0.007, 0.002, 0.075, 0.009, 0.652),
    ("adjectives", "weights"): (0.034, 0.003, 0.075, 0.055, 0.080, 0.000),
    ("features", "weights"): (0.201, 0.001, 0.013, 0.015, 0.001, 0.000),
}
"""Times of adjusting."""
