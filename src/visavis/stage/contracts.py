"""The interface between a session and a stage that shows its scenes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DeviceError
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import Pose
from visavis.lab.schema import SampleBatch, StreamSchema
from visavis.stimuli.picture import Camera
from visavis.stimuli.scene import SceneFrame


@dataclass(frozen=True, eq=False)
class Glance:
    """What the participant saw a moment ago, small: `image` (height, width, 3) in sRGB, top row
    first, and the eye it was drawn for.
    """

    image: npt.NDArray[np.uint8]
    camera: Camera


class Viewer(Protocol):
    """A viewer of the display: a simulated participant, an operator's mirror."""

    def see(self, view: SceneFrame, t_display_ns: int) -> None:
        """Receive what the display shows from `t_display_ns` on."""
        ...


class Stage(Protocol):
    """Draws a scene from the participant's eyes."""

    @property
    def schemas(self) -> tuple[StreamSchema, ...]:
        """The streams it delivers: what was drawn, frame by frame."""
        ...

    def start(self, sink: Callable[[SampleBatch], None]) -> None:
        """Deliver its streams to `sink` from now on."""
        ...

    def trouble(self) -> DeviceError | None:
        """Return the problem that prevents drawing; the session pauses while there is one."""
        ...

    def foresee(self, coming: Callable[[], SceneFrame | None]) -> None:
        """Prepare the scene from `coming` in the background, so that its first frame is in time."""
        ...

    @property
    def is_preparing(self) -> bool:
        """Whether it is worth waiting, in frames without people, for what was foreseen."""
        ...

    def draw(self, view: SceneFrame, frame: FrameInfo, head: Pose) -> Sequence[object]:
        """Return the images to submit for this frame, left eye first; empty when none."""
        ...

    def handed_over(self) -> None:
        """Do the work that can wait until the images are submitted: the operator's picture."""
        ...

    def glance(self) -> Glance | None:
        """Return what the participant saw, for an operator elsewhere who asks again and again.

        None where nothing is drawn, and most of the time: there are two a second at most.
        """
        ...

    @property
    def asks(self) -> bool:
        """Whether questions with options are asked on a board in the scene."""
        ...

    def watch(self, role: str, batch: SampleBatch) -> None:
        """Receive a device's samples: gaze for the operator's view, the body for an avatar."""
        ...

    def close(self) -> None:
        """Release the display's resources; idempotent."""
        ...


class GeometryStage:
    """Show a scene as geometry only: nothing is drawn, the viewers still see it."""

    def __init__(self, viewers: Sequence[Viewer] = (), *, asks: bool = False) -> None:
        self._viewers = tuple(viewers)
        self.asks = asks

    @property
    def schemas(self) -> tuple[StreamSchema, ...]:
        """No streams: nothing is drawn."""
        return ()

    def start(self, sink: Callable[[SampleBatch], None]) -> None:
        """Deliver nothing."""

    def trouble(self) -> None:
        """Nothing can fail."""

    def foresee(self, coming: Callable[[], SceneFrame | None]) -> None:
        """Prepare nothing: nothing is drawn."""

    @property
    def is_preparing(self) -> bool:
        """Nothing is."""
        return False

    def handed_over(self) -> None:
        """Nothing was."""

    def glance(self) -> None:
        """Nothing is drawn."""

    def draw(self, view: SceneFrame, frame: FrameInfo, head: Pose) -> Sequence[object]:
        """Pass the geometry to every viewer."""
        self.tell(view, frame.predicted_display_ns)
        return ()

    def tell(self, view: SceneFrame, t_display_ns: int) -> None:
        """Pass the geometry to every viewer, who sees it from a time on."""
        for viewer in self._viewers:
            viewer.see(view, t_display_ns)

    def watch(self, role: str, batch: SampleBatch) -> None:
        """Ignore it."""

    def close(self) -> None:
        """Release nothing."""
