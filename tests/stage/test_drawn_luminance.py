"""What is drawn has the asked contrast and grey on a display whose luminances were measured."""

from dataclasses import replace

import numpy as np
import pytest

from tests.stage.test_flat_stimuli import HEAD, SCREEN, drawn
from visavis.lab.luminance import GREY, luminance_table
from visavis.lab.screen import PlacedScreen
from visavis.stimuli.flat import Dots, Grating, Shape, Text
from visavis.stimuli.panels import Surface

BLACK, SPAN = 1.5, 150.0


def light(values):
    """Return what the planted display emits (cd/m²): gamma 2.2 over a black that is not dark."""
    return BLACK + SPAN * (np.asarray(values) / 255) ** 2.2


ROWS = [(GREY, level, float(light(level))) for level in (0, 32, 64, 96, 128, 160, 192, 224, 255)]
MEASURED = replace(SCREEN, luminance=luminance_table(ROWS, "planted", "0" * 64))
SURFACE = Surface(PlacedScreen(MEASURED, HEAD))
GROUND = (128,) * 3


def light_of(*items):
    return light(drawn(*items, surface=SURFACE, background=GROUND)[..., 0])


@pytest.mark.parametrize("contrast_01", [0.05, 0.1, 0.25, 0.5, 0.8, 0.95])
def test_a_grating_has_the_asked_contrast_of_light(contrast_01):
    seen = light_of(Grating(8.0, 0.5, contrast_01, mask="none"))[180, 240:400]
    michelson = (seen.max() - seen.min()) / (seen.max() + seen.min())
    assert contrast_01 == pytest.approx(michelson, abs=0.006)  # half a level at both ends
    assert BLACK + SPAN / 2 == pytest.approx((seen.max() + seen.min()) / 2, rel=0.01)


def test_half_the_contrast_is_half_of_the_swing_of_light():
    half, whole = (
        np.ptp(light_of(Grating(8.0, 0.5, c, mask="none"))[180, 240:400]) for c in (0.49, 0.98)
    )
    assert 0.5 == pytest.approx(half / whole, abs=0.005)


def test_more_contrast_than_the_screen_has_is_all_that_it_has():
    seen = light_of(Grating(8.0, 0.5, 1.0, mask="none"))[180, 240:400]
    assert (light(0), light(255)) == pytest.approx((seen.min(), seen.max()), abs=0.3)


def test_the_wave_is_a_cosine_in_light():
    seen = light_of(Grating(8.0, 0.5, 0.9, mask="none"))[180, 240:400]
    wave = np.abs(np.fft.rfft((seen - seen.mean()) * np.hanning(len(seen)), 4096))
    first = wave[: 4 * wave.argmax() // 2].max()
    assert wave[2 * wave.argmax() - 5 : 2 * wave.argmax() + 5].max() < 0.02 * first


def test_a_gabor_patch_goes_over_into_its_background_without_an_edge():
    seen = drawn(Grating(4.0, 1.0, 0.9), surface=SURFACE, background=GROUND)
    assert {186} == set(np.unique(seen[100]).tolist())
    left = np.flatnonzero(seen[180, :, 0] != 186)[0]
    assert abs(int(seen[180, left, 0]) - 186) <= 2


@pytest.mark.parametrize("grey", [0, 30, 64, 128, 200, 255])
def test_a_grey_is_its_share_of_the_light_in_shapes_and_dots(grey):
    share = np.interp(grey, (0, 128, 255), (0, 0.5, 1))
    for item in (
        Shape("rectangle", 4.0, colour=(grey,) * 3),
        Dots(1.0, speed_deg_per_s=0, width_deg=4.0, dot_deg=1.5, colour=(grey,) * 3, seed=1),
    ):
        seen = light_of(item)
        off = np.abs(seen - (BLACK + SPAN * share)).min()
        assert off < 0.01 * (BLACK + SPAN)
        if grey != 128:
            assert len(np.unique(seen)) >= 2


def test_colours_are_as_they_were():
    item = Shape("rectangle", 4.0, colour="orange")
    measured, plain = (
        drawn(item, Text("ä", colour="red"), surface=surface) for surface in (SURFACE, None)
    )
    assert (plain == measured).all()
