"""Cells of a crowd: Delaunay triangles, walks of paths through them, and how alike walks are.

Ground-plane coordinates are any right-handed pair (x, y) in metres.
"""

from visavis.analysis.cells.errors import (
    AllInLine,
    CellError,
    Cocircular,
    MalformedPositions,
    SamePlace,
    TooFewPeople,
)
from visavis.analysis.cells.similarity import (
    BlockComparison,
    Paths,
    SplitSimilarity,
    Variant,
    between_blocks,
    compare_blocks,
    compare_blocks_together,
    dice,
    frequency_dice,
    group_dice,
    jackknifed_excess,
    own_block_excess,
    within_block,
)
from visavis.analysis.cells.triangulation import Cell, Triangulation, triangulate
from visavis.analysis.cells.walk import (
    CellPath,
    Crossing,
    folded_angle_deg,
    gap_angles_deg,
    locate,
    walk,
)

__all__ = [
    "AllInLine",
    "BlockComparison",
    "Cell",
    "CellError",
    "CellPath",
    "Cocircular",
    "Crossing",
    "MalformedPositions",
    "Paths",
    "SamePlace",
    "SplitSimilarity",
    "TooFewPeople",
    "Triangulation",
    "Variant",
    "between_blocks",
    "compare_blocks",
    "compare_blocks_together",
    "dice",
    "folded_angle_deg",
    "frequency_dice",
    "gap_angles_deg",
    "group_dice",
    "jackknifed_excess",
    "locate",
    "own_block_excess",
    "triangulate",
    "walk",
    "within_block",
]
