"""Drive the eye tracker of a Vive headset through SRanipal: per-eye rays, pupils, openness.

Codec: `visavis.devices.drivers.sranipal.codec`. Transport:
`visavis.devices.drivers.sranipal.library`. A frame that was missed leaves a hole in `seq`.
It is calibrated in SteamVR. The openness of the eyes is a second stream, `openness`.
"""

from collections.abc import Iterable
from dataclasses import replace

from visavis.devices.drivers.sranipal import codec
from visavis.devices.drivers.sranipal.spec import VIVE_PRO_EYE
from visavis.devices.drivers.streaming.gaze_rays import Sample
from visavis.devices.drivers.streaming.openness import GazeAndOpenness
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import Clock
from visavis.lab.errors import DeviceError, DeviceNotFound


class ViveProEye(GazeAndOpenness):
    """Follow the `EyeTracker` contract over SRanipal; `seq` follows its frame numbers.

    SRanipal only says whether a headset is a Vive Pro Eye. Any other whose eye data come is taken,
    and `check` says so.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        rate_hz: float = 120.0,
        lost_after_s: float = 2.0,
    ) -> None:
        self._has_frame = False
        super().__init__(
            role, transport, clock, VIVE_PRO_EYE, rate_hz=rate_hz, lost_after_s=lost_after_s
        )

    def _connect(self, deadline_ns: int) -> None:
        self._has_frame = False
        answer = self._ask((b"start",), deadline_ns).frames
        if answer[-1] == b"\x01":
            return
        try:
            self._wait_until(lambda: self._has_frame, deadline_ns, "eye data")
        except DeviceError as cause:
            text = "SRanipal runs, but the headset is not a Vive Pro Eye and gives no eye data"
            raise DeviceNotFound(text, remedy=VIVE_PRO_EYE.remedy) from cause
        self.info = replace(self.info, model="eye tracker of SRanipal")
        fault = self._warning(
            "SRanipal does not call this headset a Vive Pro Eye; its data are read like one's",
            "compare a short capture with looks to the left and up before you rely on it",
        )
        self._note("model", fault)

    def _decode(self, message: Message) -> Iterable[Sample]:
        frame = codec.decode_eye_data(message.frames[0])
        if frame is None:
            self._malformed += 1
            return ()
        self._has_frame = True
        fault = self._warning("nobody wears the headset", "put it on")
        self._note("worn", None if frame.is_worn else fault)
        return (frame.sample,)
