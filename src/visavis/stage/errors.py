"""Errors while drawing."""

from visavis.lab.errors import DeviceError

INSTALL_MESA = (
    "install a graphics driver with EGL "
    "(Debian, Ubuntu: apt install libegl1 libgl1 libgl1-mesa-dri libegl-mesa0), "
    "or set display.show to none in lab_config.yaml"
)


class StageError(DeviceError):
    """The display cannot draw; the session pauses on it as on any device."""

    def __init__(self, message: str, *, remedy: str = "") -> None:
        super().__init__(message, role="display", remedy=remedy)
