"""Areas of a panorama behind a monitor, as the viewer outlines them: cut at its edges, not bent."""

import base64
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

import visavis.cli.viewer
from visavis.cli.viewer.bundle import Bundle
from visavis.cli.viewer.flat import Showing, flat_content
from visavis.cli.viewer.models import Models
from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Pose, quat_conjugate, quat_from_yaw_pitch_deg, rotate, unit
from visavis.lab.screen import FlatScreen, PlacedScreen
from visavis.stimuli.areas import Area, SurroundingAreas, areas_at
from visavis.stimuli.dressing.picture_of import NOBODY, NOWHERE
from visavis.stimuli.panels import Surface
from visavis.stimuli.picture import Picture
from visavis.stimuli.scenes.flat import FlatScene
from visavis.stimuli.view_turns import Turn, ViewTurns

SCRIPTS = Path(visavis.cli.viewer.__file__).parent
AROUND_PX = (2048, 1024)
AROUND_AREAS = {  # in degrees to the right of the picture's middle and upwards
    "slope": [(-5, 20), (55, 5), (55, -20), (-5, -5)],
    "seam": [(150, 30), (215, -10), (215, -30), (150, 5)],
    "notch": [(10, 60), (60, 75), (90, 20), (35, 45)],
    "band": [(-170, 15), (170, 15), (170, -15), (-170, -15)],  # with a gap behind
    "all": [(-179, 85), (179, 85), (179, -85), (-179, -85)],
}
TURNS_DEG = {0: (0.0, 0.0), 1: (30.0, 60.0), 2: (150.0, -30.0)}
"""How far the view is turned, to the right and upwards, at whole seconds."""


def turned_view() -> tuple[FlatScene, SurroundingAreas]:
    """Return a panorama, 20 degrees to the right ahead, and its areas behind a tilted monitor."""
    flat = FlatScreen(0.5, 0.3, 1920, 1080, 0.45, center_right_m=0.04, center_up_m=-0.03)
    eyes = Pose(np.array([0.1, 1.2, 0.0]), quat_from_yaw_pitch_deg(30.0, 0.0))
    screen = PlacedScreen(flat, eyes)
    turns = ViewTurns(1, [Turn(t * NS_PER_S - 1, at, at) for t, at in TURNS_DEG.items() if t])
    outlines = {
        name: tuple(((180 + x) / 360 * AROUND_PX[0], (90 - y) / 180 * AROUND_PX[1]) for x, y in of)
        for name, of in AROUND_AREAS.items()
    }
    areas = tuple(Area(name, outline) for name, outline in outlines.items())
    around = SurroundingAreas(eyes, 20.0, AROUND_PX, areas, turns, screen=screen)
    scene = FlatScene("flat", (), surface=Surface(screen), turns=turns)
    return scene, around


def angle_deg(some: Any, others: Any) -> np.ndarray[Any, Any]:
    """Return how far each of some directions (n, 3) is from the nearest of others (m, 3)."""
    chords = cKDTree(others).query(some)[0]
    return np.asarray(np.degrees(2 * np.arcsin(chords / 2)))


def dense(corners: Any, count: int) -> np.ndarray[Any, Any]:
    """Return a closed line with so many points on each of its edges."""
    shares = np.arange(count)[:, None, None] / count
    line = corners + shares * (np.roll(corners, -1, axis=0) - corners)
    return line.transpose(1, 0, 2).reshape(-1, corners.shape[1])


@pytest.mark.slow  # a browser
def test_an_area_of_a_panorama_that_the_monitor_cuts_is_outlined_where_it_is(browser: Any) -> None:
    scene, around = turned_view()
    assert around.screen is not None
    flat, eye = around.screen.flat, around.pose
    bundle, nothing = Bundle(), Picture(0, NOWHERE, (), NOBODY)
    times = [t * NS_PER_S for t in TURNS_DEG]
    data = flat_content(
        Showing(scene, (around,)), times, [nothing] * 3, Models(bundle, level=1), bundle
    )
    raw = zlib.decompress(base64.b64decode(bundle.text({})))[16:]
    for area in data["areas"]:
        for name in ("corners", "hasCorner"):
            ref = area[name]
            values = np.frombuffer(raw, "<" + ref["d"], int(np.prod(ref["s"])), ref["o"])
            area[name] = {"s": ref["s"], "v": values.tolist()}
    page = browser.new_page()
    for name in ("data.js", "cutting.js", "flat.js"):
        page.add_script_tag(path=SCRIPTS / name)
    areas_by_time = page.evaluate(
        """data => { const flat = new Flat({flat: ref => ref.v}, data);
            return [0, 1, 2].map(k => flat.areasAt(k)); }""",
        data,
    )
    grid_px = np.stack(np.meshgrid(np.arange(16, 1920, 32.0), np.arange(15, 1080, 30.0)), axis=-1)
    grid = rotate(eye.orientation_wxyz, flat.directions_of(grid_px.reshape(-1, 2)))
    cut = 0
    for t_ns, areas in zip(times, areas_by_time, strict=True):
        by_name = {area["name"]: area for area in areas}
        for area in around.areas:
            exact = unit(
                around.places_m(dense(np.array(area.outline), 5000), t_ns) - eye.position_m
            )
            exact = exact[around.is_shown(np.broadcast_to(eye.position_m, exact.shape), exact)]
            is_inside = areas_at(
                [area], *around.pixels_met(grid, np.full(len(grid), t_ns)), around_px=AROUND_PX[0]
            )
            if area.name not in by_name:
                assert not len(exact), (area.name, t_ns)
                assert (is_inside < 0).all()
                continue
            counts = by_name[area.name]["outlines"]
            corners = np.split(np.array(by_name[area.name]["corners"]), np.cumsum(counts)[:-1])
            lines = [unit(dense(line, 100) - eye.position_m) for line in corners]
            outline = np.concatenate(lines)
            own = rotate(quat_conjugate(eye.orientation_wxyz), outline)
            x, y = flat.pixels_of(flat.meets_m(np.zeros_like(own), own)).T
            beyond = np.maximum(abs(x / flat.width_px - 0.5), abs(y / flat.height_px - 0.5))
            assert beyond.max() < 0.5 + 1e-6
            is_edge = beyond > 0.5 - 1e-6
            cut += bool(is_edge.any())
            if len(exact):
                assert angle_deg(exact, outline).max() < 0.5
                apart_deg = np.where(is_edge, 0.0, angle_deg(outline, exact))
                assert apart_deg.max() < 0.5
            is_drawn_inside = np.zeros(len(grid), bool)
            for px in np.split(np.stack([x, y], axis=1), np.cumsum([*map(len, lines)])[:-1]):
                line = Area("", tuple(map(tuple, px.tolist())))
                is_drawn_inside ^= line.holds(*grid_px.reshape(-1, 2).T)
            is_near = angle_deg(grid, exact) < 0.5 if len(exact) else np.zeros(len(grid), bool)
            assert ((is_inside == 0) == is_drawn_inside)[~is_near].all(), (area.name, t_ns)
            # along the monitor's edge it is where the area is
            px, py = around.pixels_met(outline[is_edge], np.full(is_edge.sum(), t_ns))
            far = areas_at(
                [area], px, py, pad=0.5, unit_px=(180 / AROUND_PX[1],) * 2, around_px=AROUND_PX[0]
            )
            assert (far == 0).all(), (area.name, t_ns)
    assert cut >= 4
