"""A camera on the head is turned as its wearer's gaze at the targets shows, not as was typed in."""

from pathlib import Path

import numpy as np

from tests.faults.sessions import events, lab, perform
from visavis.devices.registry import driver_spec
from visavis.lab.config import DeviceConfig


def test_a_tilted_camera_is_fitted_stored_and_measured_right(tmp_path: Path) -> None:
    config = lab(tmp_path)
    # The simulated camera looks straight ahead, so the driver takes gaze 15° too high.
    options = driver_spec("neon").options(rate_hz=60.0, camera_pitch_deg=15.0).model_dump()
    neon = DeviceConfig(role="eye_tracker", driver="neon", simulated=True, options=options)

    recording = perform(
        config.model_copy(update={"devices": {**config.devices, "eye_tracker": neon}})
    )

    first = events(recording, "camera_on_head")[0]
    assert abs(first["angle_deg"] - 15.0) < 2.0
    assert first["residual_deg"] < 1.5
    assert abs(np.linalg.det(np.array(first["rotation"])) - 1.0) < 1e-9
    measured = [e["accuracy_deg"] for e in events(recording, "validation")]
    assert max(measured) < 3.0
