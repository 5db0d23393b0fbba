"""A picture of what blends of examples come to: the planes of every two groups of features."""

from pathlib import Path

from visavis.analysis.plots import BLUE, new_figure
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.synthesis.reach import CELLS, Reach

UNREACHED = "#e6e6e6"


def write_reach_map(path: Path, reach: Reach, examples: Vector) -> None:
    """Draw the cells of every plane that any blend comes to, with the examples (n, d) as dots."""
    planes = list(reach.planes)
    columns = 3
    rows = -(-len(planes) // columns)
    figure = new_figure(2.7 * columns, 2.7 * rows)
    axes = figure.subplots(rows, columns, squeeze=False)
    for k, (i, j) in enumerate(planes):
        ax = axes[k // columns][k % columns]
        ax.set_facecolor(UNREACHED)
        for row, column in zip(*reach.cells(i, j).nonzero(), strict=True):
            cell = [column / CELLS, row / CELLS]
            ax.fill(
                [cell[0], cell[0] + 1 / CELLS, cell[0] + 1 / CELLS, cell[0]],
                [cell[1], cell[1], cell[1] + 1 / CELLS, cell[1] + 1 / CELLS],
                color=BLUE,
                alpha=0.45,
                linewidth=0,
            )
        ax.plot(examples[:, i], examples[:, j], ".", color="black", markersize=3)
        ax.set(
            xlim=(0, 1),
            ylim=(0, 1),
            xlabel=reach.names[i].replace("_", " "),
            ylabel=reach.names[j].replace("_", " "),
        )
    for k in range(len(planes), rows * columns):
        axes[k // columns][k % columns].set_visible(False)
    figure.savefig(path, dpi=150)
