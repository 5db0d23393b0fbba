"""The quiet frames of a showing: how many were lit, and what each one showed."""

from collections.abc import Callable, Sequence

from visavis.lab.geometry import Vector
from visavis.protocol.plan.steps import FrameView, GazeView, Unchanged, UpdateAhead
from visavis.stimuli.scene import SceneFrame
from visavis.study.film_pictures import FilmPictures


class LitFrames(UpdateAhead):
    """The `update` of quiet frames of a showing, which counts them as long as `is_lit`.

    `update` returns what comes after a frame. What `stays` is not asked for it. `count` begins with
    the frames that were lit before.
    """

    def __init__(
        self,
        update: Callable[[FrameView], SceneFrame | None],
        pictures: FilmPictures,
        count: int,
        *,
        stays: bool,
    ) -> None:
        self._update = update
        self._pictures = pictures
        self._stays = stays
        self.count = count
        self.is_lit = True

    def note(self, t_ns: int) -> None:
        """Count a frame that began at a time, and the pictures of films in it."""
        if self.is_lit:
            self.count += 1
            self._pictures.note(t_ns)

    def __call__(self, view: FrameView) -> SceneFrame | None:
        """Return what to show after a frame; None without a change."""
        self.note(view.t_ns)
        return self._update(view)

    def ahead(self, t_ns: Sequence[int], heads_m: Vector) -> Unchanged | None:
        """Return that nothing new is shown; None where that is not known."""
        return Unchanged(t_ns) if self._stays or not self.is_lit else None

    def pass_frames(self, pictures: Unchanged, gazes: Sequence[GazeView]) -> None:
        """Count as many frames as there are gazes."""
        for t_ns in pictures.t_ns[: len(gazes)]:
            self.note(t_ns)
