"""Faults of a headset of an OpenVR runtime, with remedies for the operator."""

from collections.abc import Mapping
from dataclasses import dataclass

from visavis.devices.contracts import Fault
from visavis.devices.drivers.openvr.spec import OPENVR_HEADSET

FOCUS_LOST = "CompositorError_DoNotHaveFocus"
COMPOSITOR_REMEDIES = {
    "CompositorError_InvalidTexture": "the images were not textures of the current GL context: "
    "keep the context current, and submit RGBA8 textures that still exist",
    "CompositorError_TextureIsOnWrongDevice": "let the graphics card that drives the headset "
    "draw: choose it for Python in the graphics settings",
    "CompositorError_TextureUsesUnsupportedFormat": "submit RGBA8 textures without mip maps",
    "CompositorError_SharedTexturesNotSupported": "update the graphics driver",
    "CompositorError_AlreadySubmitted": "wait for the next frame before submitting again",
    "CompositorError_IsNotSceneApplication": "open the runtime as a scene application",
    "CompositorError_DoNotHaveFocus": "close the other VR program or SteamVR's dashboard",
}


@dataclass
class Findings:
    """Current problems; `submit_problem` is the error with which images were refused."""

    standby: bool = False
    taken_off: bool = False
    has_lost_focus: bool = False
    untracked: bool = False
    submit_problem: str = ""

    def faults(self, role: str, loss: str, moved_m: Mapping[str, float]) -> tuple[Fault, ...]:
        """Return the faults; `loss` says why the runtime is gone, `moved_m` is per base station."""
        faults = []
        if loss:
            faults.append(Fault(role, "blocking", loss, OPENVR_HEADSET.remedy))
        if self.standby:
            remedy = "ask the participant to put the headset on; wake it by moving it"
            faults.append(Fault(role, "blocking", "no head tracking: in standby", remedy))
        elif self.taken_off:
            remedy = "ask the participant to put the headset on"
            faults.append(Fault(role, "warning", "the headset is not worn", remedy))
        if self.untracked:
            remedy = "check that the base stations see the headset, and that it is connected"
            faults.append(Fault(role, "blocking", "the headset is not tracked", remedy))
        if self.has_lost_focus:
            remedy = COMPOSITOR_REMEDIES[FOCUS_LOST]
            faults.append(Fault(role, "blocking", "another VR program has the display", remedy))
        if self.submit_problem:
            remedy = COMPOSITOR_REMEDIES.get(self.submit_problem, OPENVR_HEADSET.remedy)
            text = f"images were refused: {self.submit_problem}"
            faults.append(Fault(role, "blocking", text, remedy))
        for serial, far_m in moved_m.items():
            text = f"base station {serial} moved by {far_m * 1e3:.0f} mm"
            remedy = "fix it to its place and run the room setup again"
            faults.append(Fault(role, "warning", text, remedy))
        return tuple(faults)
