"""How long blending walks takes, and how exact it is.

    python -m benchmarks.blending [--json]

27 walks of 20 joints: a fit of weights to four parameters made anew, weights at a point, one pose
blended of all walks (CPU time, the best of several rounds); how far weights at the examples are
from one and none; the fastest slip of heel or ball while a foot stands, over random blends.
"""

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from visavis.experiments.adjectives.raters import expected_impressions
from visavis.lab.clock import cpu_time_s
from visavis.lab.geometry import rotate
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.motion.synthesis.example_blend import Blend, blend_at
from visavis.stimuli.motion.synthesis.style_weights import fit_weights
from visavis.stimuli.motion.synthesis.walk_styles import walk_set

TIMES, ROUNDS = 200, 5
BLENDS = 30
RATE_HZ = 480.0


@dataclass(frozen=True)
class Figures:
    """What is printed."""

    refit_ms: float
    weights_ms: float
    pose_ms: float
    off_at_examples: float
    slip_mm_s: float


def _best_ms(call: Callable[[], object]) -> float:
    """Return the CPU time of a call, the best mean of several rounds."""
    call()
    best = float("inf")
    for _ in range(ROUNDS):
        begin = cpu_time_s()
        for _ in range(TIMES):
            call()
        best = min(best, (cpu_time_s() - begin) / TIMES * 1e3)
    return best


def slip_mm_s(blend: Blend) -> float:
    """Return the greatest speed of whichever of heel and ball is slower while a foot stands."""
    t_s = np.arange(0.0, blend.cycle_s, 1.0 / RATE_HZ)
    frames, phase = blend.at(t_s), blend.phase_of(t_s)
    body = forward(blend.skeleton, frames.root_m, frames.orientation_wxyz)
    most = 0.0
    for side, stands in (("left", phase < 3.0), ("right", (phase >= 2.0) | (phase < 1.0))):
        foot, toes = (blend.skeleton.index(f"{side}_{part}") for part in ("foot", "toes"))
        ball, turn = body.position_m[:, toes], body.orientation_wxyz[:, foot]
        heel = body.position_m[:, foot] + rotate(
            turn, np.broadcast_to(blend.examples.heel_m, ball.shape)
        )
        both = stands[1:] & stands[:-1]
        speeds = [np.linalg.norm(np.diff(p[:, [0, 2]], axis=0), axis=1)[both] for p in (heel, ball)]
        most = max(most, float(np.minimum(*speeds).max()) * RATE_HZ * 1e3)
    return most


def figures() -> Figures:
    """Measure."""
    walks = walk_set("set_b")
    points = expected_impressions(walks)
    fitted = fit_weights(points)
    rng = np.random.default_rng(1)
    p = rng.uniform(size=4)
    shares = np.full(len(walks), 1.0 / len(walks))
    weights = [rng.dirichlet(np.full(len(walks), 0.3)) for _ in range(BLENDS)]
    return Figures(
        refit_ms=_best_ms(lambda: fit_weights(points)),
        weights_ms=_best_ms(lambda: fitted.at(p)),
        pose_ms=_best_ms(lambda: blend_at(walks, shares, 1.3)),
        off_at_examples=float(np.abs(fitted.at(points) - np.eye(len(walks))).max()),
        slip_mm_s=max(slip_mm_s(Blend(walks, own)) for own in weights),
    )


def main() -> int:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--json", action="store_true")
    as_json = parser.parse_args().json
    found = asdict(figures())
    if as_json:
        print(json.dumps(found, indent=2))
        return 0
    for name, value in found.items():
        print(f"{name:<16} {value:.3g}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
