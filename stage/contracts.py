"""What the session asks of whatever shows a scene."""

from collections.abc import Sequence
from typing import Protocol

from lab.frame import FrameInfo
from lab.geometry import Pose
from stimuli.scene import SceneFrame


class Viewer(Protocol):
    """Someone who watches the display: a simulated participant, an operator's mirror."""

    def see(self, view: SceneFrame, t_display_ns: int) -> None:
        """Receive what the display shows from `t_display_ns` on."""
        ...


class Stage(Protocol):
    """Draws a scene from the participant's eyes."""

    def draw(self, view: SceneFrame, frame: FrameInfo, head: Pose) -> Sequence[object]:
        """Return the images to submit for this frame, left eye first; empty when none."""
        ...

    def close(self) -> None:
        """Release the display's resources; idempotent."""
        ...


class GeometryStage:
    """Show a scene as geometry only: nothing is drawn, the viewers still see it."""

    def __init__(self, viewers: Sequence[Viewer] = ()) -> None:
        self._viewers = tuple(viewers)

    def draw(self, view: SceneFrame, frame: FrameInfo, head: Pose) -> Sequence[object]:
        """Tell every viewer what stands there."""
        for viewer in self._viewers:
            viewer.see(view, frame.predicted_display_ns)
        return ()

    def close(self) -> None:
        """Release nothing."""
