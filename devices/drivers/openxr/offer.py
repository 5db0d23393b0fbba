"""Ask an OpenXR runtime, in a separate process, whether it offers gaze.

Run as `python -m visavis.devices.drivers.openxr.offer`, it asks the runtime that `XR_RUNTIME_JSON`
names and prints JSON. A process can load only one runtime, and a vendor's runtime may crash it.
"""

import contextlib
import io
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from visavis.devices.drivers.openxr.actions import supports_gaze
from visavis.devices.drivers.openxr.eyes import SUPPORTED, extension_for_eyes
from visavis.devices.drivers.openxr.library import EYE_GAZE

PATIENCE_S = 20.0
"""Some runtimes start their service only when they are asked."""


@dataclass(frozen=True)
class Offer:
    """Eye tracking of a runtime: `gaze` by the standard's extension, `eyes_by` the one per eye.

    `has_headset` is False where the runtime finds no headset, so that it cannot say.
    """

    runtime: str
    has_headset: bool
    gaze: bool
    eyes_by: str

    @property
    def tells_gaze(self) -> bool:
        """Tell whether the runtime offers gaze in any way."""
        return self.gaze or bool(self.eyes_by)


def ask(manifest: Path) -> Offer | None:
    """Return what the runtime of a manifest offers; None when it cannot be asked."""
    environment: Mapping[str, str] = {**os.environ, "XR_RUNTIME_JSON": str(manifest)}
    command = [sys.executable, "-m", "visavis.devices.drivers.openxr.offer"]
    try:
        process = subprocess.run(  # noqa: S603 - ourselves
            command, capture_output=True, text=True, timeout=PATIENCE_S, env=environment, check=True
        )
        return Offer(**json.loads(process.stdout.strip().splitlines()[-1]))
    except (OSError, subprocess.SubprocessError, ValueError, TypeError, IndexError):
        return None  # not fully installed, crashed, or silent


def offer() -> Offer:
    """Ask the runtime of this process; raises what pyopenxr raises."""
    import xr

    extensions = {p.extension_name for p in xr.enumerate_instance_extension_properties()}
    names = {n.decode() if isinstance(n, bytes) else str(n) for n in extensions}
    per_eye = extension_for_eyes(names)
    enabled_names = [name for name in (EYE_GAZE, per_eye) if name and name in names]
    application = xr.ApplicationInfo(application_name="Visavis", api_version=xr.Version(1, 0, 0))
    instance = xr.create_instance(
        xr.InstanceCreateInfo(application_info=application, enabled_extension_names=enabled_names)
    )
    try:
        name: Any = xr.get_instance_properties(instance).runtime_name
        runtime_name = name.decode() if isinstance(name, bytes) else str(name)
        try:
            kind = xr.FormFactor.HEAD_MOUNTED_DISPLAY
            system = xr.get_system(instance, xr.SystemGetInfo(form_factor=kind))
        except xr.exception.FormFactorUnavailableError:
            return Offer(runtime_name, has_headset=False, gaze=False, eyes_by="")
        gaze = EYE_GAZE in enabled_names and supports_gaze(xr, instance, system)
        each = bool(per_eye) and SUPPORTED[per_eye](xr, instance, system)
        return Offer(runtime_name, has_headset=True, gaze=gaze, eyes_by=per_eye if each else "")
    finally:
        xr.destroy_instance(instance)


if __name__ == "__main__":
    with contextlib.redirect_stdout(io.StringIO()):  # keep the package's own output apart
        own_offer = offer()
    print(json.dumps(asdict(own_offer)))  # noqa: T201 - the parent reads it
