"""Smooth noise is made of sines that are computed without a call."""

import numpy as np
import pytest

from visavis.stimuli.motion.rhythm_kernels import sine_of_turns


def test_sine_of_turns_is_the_sine_to_the_last_digits() -> None:
    quarters = np.arange(-2.0, 2.0, 0.25)
    edges = np.concatenate([quarters, np.nextafter(quarters, -9.0), np.nextafter(quarters, 9.0)])
    turns = np.concatenate([edges, np.random.default_rng(1).uniform(-1.0, 1.0, 5000)])

    sines = np.array([sine_of_turns(x) for x in turns])

    assert sines == pytest.approx(np.sin(2.0 * np.pi * turns), abs=2e-15)


def test_sine_of_turns_repeats_with_every_turn() -> None:
    parts = np.arange(0.0, 1.0, 1 / 64)  # exact beside any number of turns

    assert [sine_of_turns(x) for x in parts] == [sine_of_turns(x + 1000.0) for x in parts]
