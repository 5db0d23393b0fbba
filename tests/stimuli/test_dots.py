"""Random dots: places that follow from their seed, their motion, and the same numbers on a page."""

import json
import shutil
import subprocess
from dataclasses import asdict, replace

import numpy as np
import pytest

from visavis.lab.errors import DesignError
from visavis.running.page.server import SITE
from visavis.stimuli.dots import motion_of, places_deg, step_at
from visavis.stimuli.flat import Dots, Grating
from visavis.stimuli.flat_pixels import moving_pixels

DOTS = Dots(0.5, speed_deg_per_s=6, density_per_deg2=4, seed=7)
EVERY_KIND = [
    DOTS,
    replace(DOTS, lifetime_s=0.1, direction_deg=30.0, noise="position"),
    replace(DOTS, aperture="square", seed=2**32 - 1, coherence_01=0.0, colour="red"),
    replace(DOTS, lifetime_s=0.25, rate_hz=90.0, dot_deg=0.3, coherence_01=1.0),
]


def test_a_step_needs_no_step_before_it():
    forwards = [places_deg(DOTS, step) for step in range(30)]
    backwards = [places_deg(DOTS, step) for step in reversed(range(30))]
    for one, other in zip(forwards, reversed(backwards), strict=True):
        np.testing.assert_array_equal(one, other)


def test_another_seed_gives_other_places_and_no_seed_is_one_too():
    assert not np.allclose(
        places_deg(DOTS, 0), places_deg(replace(DOTS, seed=8), 0), equal_nan=True
    )
    places_deg(replace(DOTS, seed=None), 0)


def test_dots_fill_their_field_evenly_and_independently():
    wide = replace(DOTS, width_deg=20, density_per_deg2=10, aperture="square", lifetime_s=0.05)
    x, y = ((places_deg(wide, 40) + 10) / 20).T
    for values in (x, y):  # Kolmogorov and Smirnov's bound at 1 in 1,000
        ranks = (np.arange(len(values)) + 0.5) / len(values)
        assert np.abs(np.sort(values) - ranks).max() < 1.95 / np.sqrt(len(values))
    later = (places_deg(wide, 80)[:, 0] + 10) / 20  # several lives on
    for one, other in ((x, y), (x, later), (x[1:], x[:-1])):
        assert abs(np.corrcoef(one, other)[0, 1]) < 3.3 / np.sqrt(len(one))


@pytest.mark.parametrize("direction_deg", [0.0, 90.0, 210.0])
def test_all_dots_together_go_as_fast_as_asked_in_the_direction_asked(direction_deg):
    dots = replace(DOTS, coherence_01=1.0, direction_deg=direction_deg)
    moved = places_deg(dots, 11) - places_deg(dots, 10)
    moved = moved[np.hypot(*moved.T) < 1.0]  # but for those that came in on the other side
    expected = 0.1 * np.array(
        [np.cos(np.radians(direction_deg)), np.sin(np.radians(direction_deg))]
    )
    assert len(moved) > 150
    np.testing.assert_allclose(moved, np.broadcast_to(expected, moved.shape), atol=1e-12)


@pytest.mark.parametrize("noise", ["direction", "position"])
def test_the_motion_that_was_drawn_grows_with_coherence(noise):
    for coherence_01 in (0.0, 0.25, 0.5, 1.0):
        each = [
            motion_of(replace(DOTS, coherence_01=coherence_01, noise=noise, seed=seed), 0.5)
            for seed in range(12)
        ]
        right, up = np.mean(each, axis=0)
        assert right == pytest.approx(6 * coherence_01, abs=0.25)
        assert up == pytest.approx(0.0, abs=0.2)


def test_dots_of_a_life_vanish_at_different_times_and_as_often_as_asked():
    dots = replace(DOTS, speed_deg_per_s=0.0, lifetime_s=0.1, aperture="square")  # six steps
    same = [np.all(places_deg(dots, k) == places_deg(dots, k + 1), axis=1) for k in range(60)]
    assert 1 - np.mean(same) == pytest.approx(1 / 6, abs=0.005)
    assert np.ptp(np.mean(same, axis=1)) < 0.15


def test_steps_are_counted_in_time_not_in_frames():
    assert [0, 0, 1, 6, 60] == [step_at(DOTS, s) for s in (-0.01, 0.008, 0.0167, 0.1001, 1.0)]


def test_a_dot_has_its_size_and_its_colour():
    pixels = moving_pixels(
        Dots(density_per_deg2=0.02, dot_deg=0.5, colour="red", seed=1), (320, 320), 0
    )
    assert (pixels[..., :3] == (255, 0, 0)).all()
    (n_dots,) = {
        np.isfinite(places_deg(Dots(density_per_deg2=0.02, dot_deg=0.5, seed=1), 0)[:, 0]).sum()
    }
    assert n_dots * np.pi * 10**2 == pytest.approx((pixels[..., 3] == 255).sum(), rel=0.03)


def test_a_page_computes_the_same_places_and_the_same_pixels():
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs the Debian package nodejs")
    items = [
        {**asdict(d), "rgb": {"white": "#ffffff", "red": "#ff0000"}[d.colour]} for d in EVERY_KIND
    ]
    script = (
        f'import {{ placesDeg, dotsPixels, stepAt }} from "{(SITE / "dots.js").as_uri()}";'
        f"const said = {json.dumps(items)}.map((item) => [0, 1, 37, 600].map((step) => "
        "[placesDeg(item, step), [...dotsPixels(item, 120, 120, step)]]));"
        "console.log(JSON.stringify([said, stepAt(" + json.dumps(items[0]) + ", 0.1001)]));"
    )
    ran = subprocess.run(
        [node, "--input-type=module", "-e", script],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    each, step = json.loads(ran.stdout)
    assert 6 == step
    for dots, steps in zip(EVERY_KIND, each, strict=True):
        for step, (places, pixels) in zip((0, 1, 37, 600), steps, strict=True):
            own = places_deg(dots, step)
            np.testing.assert_allclose(places, own[np.isfinite(own[:, 0])], atol=1e-9)
            ours = moving_pixels(dots, (120, 120), step)
            assert (np.array(pixels).reshape(120, 120, 4) == ours).mean() > 0.9999


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"coherence_01": 1.2}, "from 0 to 1"),
        ({"speed_deg_per_s": -1}, "from 0 to a quarter"),
        ({"speed_deg_per_s": 500}, "a quarter of the field a step"),
        ({"density_per_deg2": 400}, "from 1 to 5000"),
        ({"lifetime_s": 0}, "above 0, or left out"),
        ({"noise": "brownian"}, "'direction' or 'position'"),
        ({"aperture": "oval"}, "'circle' or 'square'"),
        ({"seed": -1}, "a whole number from 0"),
        ({"dot_deg": 9}, "smaller than the field"),
        ({"rate_hz": 0}, "up to 500"),
        ({"direction_deg": float("nan")}, "give degrees"),
    ],
)
def test_dots_that_are_not_possible_are_refused_with_the_reason(wrong, says):
    with pytest.raises(DesignError, match=says):
        replace(DOTS, **wrong)


def test_numbers_of_numpy_are_written_as_plain_ones():
    assert "np." not in repr(Dots(np.float64(0.5), seed=np.int64(3)))
    assert "np." not in repr(Grating(contrast_01=np.float32(0.5)))
