"""What is shown of a rehearsal, or written of it, says that nobody took part."""

import numpy as np

from cli.app import load_lab
from cli.preview.pictures import write_below
from lab.config import with_devices
from tests.faults.sessions import CONFIG
from visavis.catalogue import find_study
from visavis.sessions.stages import window_title


def test_a_window_of_a_rehearsal_is_titled_so() -> None:
    experiment = find_study("stare").experiment({})
    rehearsal = load_lab(CONFIG, "sim", quiet=True)
    assert "Visavis: stare  ·  SIMULATED, not a participant" == window_title(rehearsal, experiment)
    assert "Visavis: stare" == window_title(with_devices(rehearsal, "real"), experiment)


def test_a_line_below_a_picture_leaves_the_picture_as_it_was() -> None:
    image = np.random.default_rng(1).integers(0, 255, (40, 300, 3), np.uint8)
    marked = np.asarray(write_below(image, "simulated"))
    assert (image == marked[:40]).all()
    assert marked[40:].min() < 128 < marked[40:].max()
