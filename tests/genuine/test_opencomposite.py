"""The OpenVR headset on OpenComposite over Monado, where somebody has built it.

VISAVIS_OPENCOMPOSITE names the folder with bin/linux64/vrclient.so; PYTHONPATH one with an openvr
package of the interfaces that it has (docs/genuine-software.md says which).
"""

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.genuine.monado import Service, missing, screen
from tests.genuine.test_monado import performed

BUILT = os.environ.get("VISAVIS_OPENCOMPOSITE", "")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(missing()), reason=f"no genuine OpenXR runtime: {missing()}"),
    pytest.mark.skipif(not BUILT, reason="VISAVIS_OPENCOMPOSITE names no OpenComposite"),
]


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    made = Service(tmp_path)
    openvr_settings = tmp_path / "config" / "openvr"
    openvr_settings.mkdir()
    paths = {"jsonid": "vrpathreg", "version": 1, "runtime": [BUILT]}
    (openvr_settings / "openvrpaths.vrpath").write_text(json.dumps(paths))
    made.environment["VR_OVERRIDE"] = BUILT
    with screen(made.environment):
        made.start()
        yield made
        made.kill()


def test_poses_are_where_the_head_was_put_and_pictures_are_taken(service: Service) -> None:
    result = performed(service, "openvr")
    assert ("streaming", []) == (result["state"], result["faults"])
    assert result["apart_m"] < 1e-4
    assert result["apart"] < 1e-6
    assert 1 < result["ahead_ms"] < 100
