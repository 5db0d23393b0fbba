"""Numbers that the source of the crowd study printed.

Source: F. Berton, F. Grzeskowiak, A. Bonneau, A. Jovane, M. Aggravi, L. Hoyet, A.-H. Olivier,
C. Pacchierotti, J. Pettré, *Crowd navigation in VR: exploring haptic rendering of collisions*,
IEEE TVCG 2020 (10.1109/TVCG.2020.3041341), as told in A. Jovane's thesis (Université de Rennes,
2023), section 4.3 and appendix B.2. Twenty-three participants, eight trials per block.
"""

from collections.abc import Mapping
from typing import Final

from visavis.experiments.crowd.design import AFTER, BEFORE, HAPTIC
from visavis.study.comparisons import published_f
from visavis.study.pairs import Printed
from visavis.study.source import MeanSd

CITATION: Final = (
    "Berton, F., et al. (2020). Crowd navigation in VR: exploring haptic rendering of collisions. "
    "IEEE Transactions on Visualization and Computer Graphics, 10.1109/TVCG.2020.3041341; as told "
    "in Jovane, A. (2023), thesis, Université de Rennes, section 4.3 and appendix B."
)
PARTICIPANTS: Final = 23
VOLUME_OF_CUBES: Final = "max_volume_published_dm3"
"""The column of volumes by the source's own rule."""

MEANS: Final[Mapping[str, Mapping[str, MeanSd]]] = {
    "collisions": {
        BEFORE: MeanSd(71.0, 29.2),
        HAPTIC: MeanSd(62.8, 34.6),
        AFTER: MeanSd(60.7, 34.6),
    },
    VOLUME_OF_CUBES: {BEFORE: MeanSd(0.8, 0.3), HAPTIC: MeanSd(0.6, 0.3)},
    "shoulders_to_gap_deg": {
        BEFORE: MeanSd(34.3, 6.0),
        HAPTIC: MeanSd(40.1, 8.2),
        AFTER: MeanSd(38.7, 3.7),
    },
    "speed_m_s": {
        BEFORE: MeanSd(0.43, 0.07),
        HAPTIC: MeanSd(0.40, 0.07),
        AFTER: MeanSd(0.42, 0.07),
    },
    "agency": {BEFORE: MeanSd(6.1, 0.9), HAPTIC: MeanSd(6.0, 0.8), AFTER: MeanSd(5.9, 0.7)},
    "change": {BEFORE: MeanSd(3.6, 1.3), HAPTIC: MeanSd(3.8, 1.5), AFTER: MeanSd(3.3, 1.5)},
    "ownership": {BEFORE: MeanSd(4.9, 1.4), HAPTIC: MeanSd(5.1, 1.2), AFTER: MeanSd(5.0, 1.2)},
    "presence": {BEFORE: MeanSd(5.2, 0.9), HAPTIC: MeanSd(5.2, 1.2), AFTER: MeanSd(5.0, 1.1)},
}
"""By column and block; the volume of the last block is drawn but not printed."""

FELL: Final = f"{BEFORE} > {HAPTIC}"
FELL_AND_STAYED: Final = f"{BEFORE} > {HAPTIC}, {AFTER}"
FELL_AND_CAME_BACK: Final = f"{BEFORE}, {AFTER} > {HAPTIC}"
ROSE_AND_STAYED: Final = f"{HAPTIC}, {AFTER} > {BEFORE}"
"""The orders of blocks that the printed means have, between those called different."""

TESTS: Final[Mapping[str, Printed]] = {
    "collisions": published_f(
        "7.13",
        2,
        44,
        p="0.002",
        eta2p="0.25",
        is_significant=True,
        order=FELL_AND_STAYED,
        where="section 4.3",
    ),
    "max_volume_dm3": published_f(
        "4.35", 2, 44, p="0.019", eta2p="0.16", is_significant=True, order=FELL, where="section 4.3"
    ),
    "shoulders_to_gap_deg": published_f(
        "13.0",
        2,
        44,
        p="<0.001",
        eta2p="0.37",
        is_significant=True,
        order=ROSE_AND_STAYED,
        where="appendix B.2",
    ),
    "speed_m_s": published_f(
        "7.14",
        "1.56",
        "34.2",
        p="0.005",
        eta2p="0.245",
        is_significant=True,
        order=FELL_AND_CAME_BACK,
        where="appendix B.2",
    ),
    "agency": Printed(False, text="p = .438", where="appendix B.2"),
    "change": Printed(False, text="p = .085", where="appendix B.2"),
    "ownership": Printed(False, text="p = .753", where="appendix B.2"),
    "presence": Printed(False, text="p = .222", where="appendix B.2"),
}
"""The tests over the three blocks."""
DIFFERENT: Final[Mapping[str, Mapping[tuple[str, str], float | None]]] = {
    "collisions": {(BEFORE, HAPTIC): 0.018, (BEFORE, AFTER): 0.002},
    "max_volume_dm3": {(BEFORE, HAPTIC): 0.016},
    "shoulders_to_gap_deg": {(BEFORE, HAPTIC): None, (BEFORE, AFTER): None},
    "speed_m_s": {(BEFORE, HAPTIC): None, (HAPTIC, AFTER): None},
}
"""The blocks that post-hoc tests call different, with the printed p where it is printed."""

DICE_BETWEEN: Final[Mapping[tuple[str, str], tuple[float, ...]]] = {
    (BEFORE, HAPTIC): (0.840, 0.884, 0.781, 0.919, 0.884, 0.828, 0.788, 0.850),
    (HAPTIC, AFTER): (0.886, 0.938, 0.932, 0.887, 0.902, 0.858, 0.816, 0.859),
    (BEFORE, AFTER): (0.850, 0.883, 0.794, 0.907, 0.853, 0.910, 0.820, 0.853),
}
"""Table B.1: Dice of all paths of two blocks, by configuration."""

DICE_BETWEEN_ALL: Final[Mapping[tuple[str, str], MeanSd]] = {
    (BEFORE, HAPTIC): MeanSd(0.847, 0.048),
    (HAPTIC, AFTER): MeanSd(0.886, 0.041),
    (BEFORE, AFTER): MeanSd(0.859, 0.040),
}
DICE_WITHIN: Final = MeanSd(0.812, 0.033)
"""Ninety values: random halves of each block, thirty times, averaged over configurations."""

INCONSISTENCIES: Final = (
    "appendix B.2 gives 88.5 % and table B.1 88.6 % for Haptic against NoHaptic2; the eight "
    "values of the table average to 88.5 %",
    "the volume of interpenetration is printed in dm⁻³; dm³ is meant",
    "the text keeps cubes in collision, which overstates a common volume about twofold: volumes "
    "by the true common volume cannot be compared with the printed ones without a look at the rule",
)
