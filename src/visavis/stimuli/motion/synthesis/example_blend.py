"""Blend example motions at one moment of their cycles. The page computes the same formulas.

*Phase.* Moments are counted in key moments: a phase φ from 0 to K is k = min(K − 1, ⌊φ⌋) and the
share h = φ − k of the way to the next one. Example i is then at t_i = (1 − h) key_i[k] + h
key_i[k + 1] of its own time. The blend's own key times are T[k] = Σ wᵢ key_i[k]; its time t is at
the phase k + (t − T[k]) / (T[k + 1] − T[k]), and a cycle takes T[K].

*A pose of an example* at t_i: f = t_i / frame_s lies between frames ⌊f⌋ and ⌊f⌋ + 1 (after the
last comes the first, moved by the example's travel). Turns are joined by Slerp over the shorter
arc; places by straight lines.

*Turns.* Each joint's turn is the weighted mean of the examples': the eigenvector with the greatest
eigenvalue of M = Σ wᵢ qᵢ qᵢᵀ (4 × 4), with the sign of the heaviest example's (the first of
several). M is squared 12 times, divided by its squared trace each time; the mean is the column
with the greatest diagonal element (the first of several), divided by its length.

*Root.* Its place is Σ wᵢ rootᵢ(t_i), the integral of the blended velocity; a round adds Σ wᵢ
travelᵢ. Who changes weights in the middle of a walk goes on from the present phase and place.

*Feet.* Mean turns alone let planted feet slide. So heel c = Σ wᵢ heelᵢ(t_i) and ball
b = Σ wᵢ ballᵢ(t_i), with mean turns *in world* F of the foot and G of the toes, are goals for
either leg: where all examples' heels stand still, or all their balls, the blend's do.

1. With o the toes' offset and e the heel's, d = (b − c) − F (o − e) leads from where the heel
   wants the ankle to where the ball does, and d₀ is d at the phase at which this foot stands flat
   (`Examples.flat_phases`). The heel is u = c_y − (b_y − (o_y − e_y)) higher than the ball's sole;
   s = u / 5 mm, between 0 and 1. The ankle's goal is a = c − F e + s (d − d₀).
2. With hip H, knee K and ankle A of the mean turns, u = H − K, v = A − K: the shin turns about
   unit(u × v) by θ₁ − θ₀, where cos θ₀ = u·v / (‖u‖‖v‖), cos θ₁ = (‖u‖² + ‖v‖² − r²) / (2‖u‖‖v‖)
   and r = ‖a − H‖, at most 0.99999 (‖u‖ + ‖v‖). Where ‖u × v‖ < 10⁻⁶ ‖u‖‖v‖ the axis is the
   thigh's x.
3. The whole leg turns about H by the smallest rotation from the new A − H to a − H.
4. In world the foot is turned by F, the toes by G.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.clip import Clip, Frames
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.skeleton import Skeleton
from visavis.stimuli.motion.synthesis.blend_kernels import ExampleRows, blend_rows
from visavis.stimuli.motion.synthesis.examples import Examples


def shares_of(weights: npt.ArrayLike, n: int) -> Vector:
    """Return weights (..., n) divided by their sum.

    Raises:
        MotionError: a weight is negative or not finite, there are not n, or all are zero.
    """
    w = np.asarray(weights, dtype=np.float64)
    if w.shape[-1:] != (n,) or not np.isfinite(w).all() or (w < 0).any():
        raise MotionError(f"{n} examples need as many weights of at least 0, got {w!s}")
    total = w.sum(axis=-1, keepdims=True)
    if (total <= 0).any():
        raise MotionError("all weights are zero; give one example a weight")
    shares: Vector = w / total
    return shares


def blend_at(examples: Examples, weights: Vector, phases: npt.ArrayLike) -> Frames:
    """Return blended poses at phases (...,), for weights (n,) or (..., n) that sum to one.

    Phases beyond 0 to K are later or earlier rounds, each further by the blended travel.
    """
    phase = np.asarray(phases, dtype=np.float64)
    if not np.isfinite(phase).all():
        raise MotionError("a phase is not a number; give finite ones")
    n, keys = examples.key_s.shape
    w = np.ascontiguousarray(np.broadcast_to(weights, (*phase.shape, n)).reshape(-1, n))
    rounds = np.floor(phase.ravel() / (keys - 1))
    own = phase.ravel() - rounds * (keys - 1)
    root = np.empty((len(own), 3))
    turns = np.empty((len(own), len(examples.skeleton.names), 4))
    rows = ExampleRows(
        examples.key_s,
        examples.first,
        examples.frame_s,
        examples.travel_m,
        examples.turns,
        examples.root_m,
        examples.foot_m,
        examples.foot_turns,
        examples.tree,
    )
    blend_rows(own, w, rows, root, turns)
    root += rounds[:, None] * (w @ examples.travel_m)
    return Frames(root.reshape(*phase.shape, 3), turns.reshape(*phase.shape, *turns.shape[1:]))


@dataclass(frozen=True, eq=False)
class Blend:
    """A motion blended from examples by weights (n,), as a function of time without end.

    `in_place` takes the way ahead out, evenly over time: the figure walks as on a treadmill.
    """

    examples: Examples
    weights: Vector
    in_place: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", shares_of(self.weights, len(self.examples)))

    @property
    def skeleton(self) -> Skeleton:
        """Skeleton whose joints turn."""
        return self.examples.skeleton

    @cached_property
    def key_s(self) -> Vector:
        """Times of the blend's key moments (K + 1,)."""
        times: Vector = self.weights @ self.examples.key_s
        return times

    @property
    def cycle_s(self) -> float:
        """How long a cycle takes."""
        return float(self.key_s[-1])

    @cached_property
    def travel_m(self) -> Vector:
        """How far a cycle leads (3,)."""
        way: Vector = self.weights @ self.examples.travel_m
        return way

    def phase_of(self, t_s: npt.ArrayLike) -> Vector:
        """Return the phases at times of any shape."""
        t = np.asarray(t_s, dtype=np.float64)
        rounds = np.floor(t / self.cycle_s)
        own = t - rounds * self.cycle_s
        last = len(self.key_s) - 1
        phase: Vector = rounds * last + np.interp(own, self.key_s, np.arange(last + 1.0))
        return phase

    def at(self, t_s: npt.ArrayLike) -> Frames:
        """Return the poses at times of any shape."""
        t = np.asarray(t_s, dtype=np.float64)
        frames = blend_at(self.examples, self.weights, self.phase_of(t))
        if not self.in_place:
            return frames
        way = (t / self.cycle_s)[..., None] * self.travel_m
        return Frames(frames.root_m - way, frames.orientation_wxyz)

    def sampled(self, frame_s: float | None = None) -> Clip:
        """Return one cycle as a looping clip, its frames about `frame_s` (the examples') apart."""
        n = max(2, round(self.cycle_s / (frame_s or self.examples.frame_s)))
        frames = self.at(np.arange(n) * self.cycle_s / n)
        x, y, z = (0.0, 0.0, 0.0) if self.in_place else self.travel_m.tolist()
        return Clip(
            self.skeleton,
            self.cycle_s / n,
            frames.root_m,
            frames.orientation_wxyz,
            True,
            (x, y, z),
        )
