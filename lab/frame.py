"""What one display frame is, for whoever paces, draws or records it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FrameInfo:
    """One frame of the display.

    `t_ns` is session time when the frame's work begins; `predicted_display_ns` when its light
    is expected to leave the display; `dropped` counts frames the runtime skipped before it.
    """

    index: int
    t_ns: int
    predicted_display_ns: int
    dropped: int = 0
