"""Drive a Tobii Pro eye tracker on a screen through the maker's SDK.

Codec: `visavis.devices.drivers.lsl.gaze_codec`, which knows Tobii's numbers. Transport:
`visavis.devices.drivers.tobii.library`. It is calibrated in Tobii Pro Eye Tracker Manager; the
session's validation measures what that is worth.
"""

from visavis.devices.drivers.lsl.gaze import LslGaze
from visavis.devices.drivers.tobii.spec import TOBII_PRO


class TobiiPro(LslGaze):
    """Follow the `EyeTracker` contract over the SDK: rays from each eye's place, and pupils."""

    spec = TOBII_PRO
