"""What a stereo frame costs on this computer, and the quality its card can keep up with."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from statistics import median

from visavis.lab.clock import NS_PER_MS, Clock
from visavis.lab.geometry import Pose
from visavis.stage.card.targets import EyeTarget
from visavis.stage.drawn_stage import default_views, eye_camera
from visavis.stage.renderer import Renderer
from visavis.stimuli.picture import Picture

FRAMES, UNCOUNTED = 20, 3
MAX_SHARE_01 = 0.7
"""Share of a frame's time for drawing; the runtime needs the rest to warp and compose."""


@dataclass(frozen=True)
class Choice:
    """Samples a pixel, and pixels drawn for one that is asked for, along each side."""

    samples: int
    render_scale: float


CHOICES = tuple(
    Choice(*pair) for pair in ((8, 1.0), (4, 1.0), (2, 1.0), (2, 0.8), (0, 0.8), (0, 0.6))
)
"""From the best to the lowest useful quality."""


def best_choice(
    cost_ms: Callable[[Choice], float], rate_hz: float, choices: Iterable[Choice] = CHOICES
) -> tuple[Choice, float]:
    """Return the first choice whose frame leaves the runtime its share, else the last, and what
    its frame costs (ms); `choices` go from the dearest to the cheapest, one at least.
    """
    best, cost = CHOICES[-1], float("nan")
    for choice in choices:
        best, cost = choice, cost_ms(choice)
        if fits(cost, rate_hz):
            break
    return best, cost


def fits(frame_ms: float, rate_hz: float) -> bool:
    """Tell whether a frame that costs so much leaves the runtime its share."""
    return frame_ms <= MAX_SHARE_01 * 1e3 / rate_hz


def stereo_frame_ms(
    renderer: Renderer,
    picture: Picture,
    head: Pose,
    size_px: tuple[int, int],
    choice: Choice,
    clock: Clock,
) -> float:
    """Return what both eyes of a picture cost (ms), median of some frames: the card's own time,
    where its driver tells it, or the time until all is drawn, whichever is longer.
    """
    context, scale = renderer.context, choice.render_scale
    size = round(scale * size_px[0]), round(scale * size_px[1])
    cameras = [eye_camera(head, eye) for eye in default_views(size[0] / size[1])]
    targets = [EyeTarget(context, size, choice.samples) for _ in cameras]
    query, costs = context.query(time=True), []
    for _ in range(UNCOUNTED + FRAMES):
        context.finish()
        t_ns = clock.now_ns()
        with query:
            renderer.draw(picture, cameras, targets)
        context.finish()
        costs.append(max(query.elapsed, clock.now_ns() - t_ns) / NS_PER_MS)
    for target in targets:
        target.release()
    return median(costs[UNCOUNTED:])
