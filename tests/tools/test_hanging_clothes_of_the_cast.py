import numpy as np
import pytest
from scipy.spatial import ConvexHull

from visavis.stimuli.characters.cast import cast_names, load_character


def _cut_at(corners: np.ndarray, level_m: float) -> np.ndarray:
    """Return points (n, 2), x and z, along the lines in which a level cuts triangles (t, 3, 3)."""
    starts, ends = corners, np.roll(corners, -1, axis=1)
    rises = (starts[..., 1] < level_m) & (ends[..., 1] >= level_m)
    falls = (starts[..., 1] >= level_m) & (ends[..., 1] < level_m)
    cut = rises.any(axis=1) & falls.any(axis=1)
    points = []
    for crosses in (rises[cut], falls[cut]):
        row, k = np.arange(len(crosses)), crosses.argmax(axis=1)
        a, b = starts[cut][row, k], ends[cut][row, k]
        points.append(a + ((level_m - a[:, 1]) / (b[:, 1] - a[:, 1]))[:, None] * (b - a))
    along = np.linspace(0, 1, 5)[:, None, None]
    lines = points[0] + along * (points[1] - points[0])
    level: np.ndarray = lines.reshape(-1, 3)[:, [0, 2]]
    return level


@pytest.mark.parametrize("name", cast_names())
def test_clothes_of_the_cast_hang_instead_of_following_the_skin(name: str) -> None:
    """Seen from behind, tops were painted into every hollow: 15 to 58 mm deep."""
    person = load_character(name)
    mesh = person.levels[0]
    tops = [i for i, m in enumerate(person.materials) if m.name == "top"]
    corners = mesh.vertices_m[mesh.triangles[np.isin(mesh.triangle_material, tops)]]
    starts = corners.transpose(1, 0, 2).reshape(-1, 3).astype(np.float64)
    hips_z = person.skeleton.rest_m[person.skeleton.index("hips")][2]
    hem_m = starts[(np.abs(starts[:, 0]) < 0.04) & (starts[:, 2] > hips_z), 1].min()
    for level_m in hem_m + np.array([0.02, 0.04, 0.06, 0.08, 0.10]):
        outline = _cut_at(corners.astype(np.float64), level_m)
        outline = outline[np.abs(outline[:, 0]) < 0.3]
        hull = ConvexHull(outline)
        behind = outline[outline[:, 1] > hips_z + 0.03]
        for at in (-0.015, 0.0, 0.015):
            # Of those one behind the other the outermost is seen.
            some = behind[np.abs(behind[:, 0] - at) < 0.02]
            outermost = some[some[:, 1].argmax()]
            depth_m = -(hull.equations[:, :2] @ outermost + hull.equations[:, 2]).max()
            assert depth_m < 0.010
