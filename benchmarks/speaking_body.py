"""Learn the synthetic speaker again, perform scripts with it, and hold both against their limits.

    python -m benchmarks.speaking_body [--minutes N] [--seeds N] [--json]

Of twenty minutes whose transitions, rules and delays are planted: how far the worst transition
(limit .05), the worst confidence of a rule with 50 cases (limit .10) and the delays (limit .03 s)
that were learnt lie from those planted. Of twenty seeds: the least p of chi-square tests of the
postures drawn against the fitted transitions alone, and against their mixture with the rules
(limit .001). Of a minute of speech: CPU seconds to perform it (limit 0.5) and to search for the
motion of one gap (limit 50 ms), how far planted feet move (limit 0.0 mm), how far filled gaps are
off their ends (limit 1e-9), and by how much velocity jumps at most where pieces meet, in 95th
percentiles (p95) of the speaker's speed (limit 1.2). Exits with 1 where one is missed.
"""

import argparse
import sys
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from benchmarks.table import Row, show
from visavis.lab.clock import cpu_time_s
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.build import build_of_skeleton
from visavis.stimuli.motion.clip import Clip, placed_joints
from visavis.stimuli.motion.skeleton import canonical_skeleton
from visavis.stimuli.motion.speaking.body_plan import WINDOW, Fill, plan_body, sample_postures
from visavis.stimuli.motion.speaking.body_track import RATE_HZ, YAW
from visavis.stimuli.motion.speaking.gesture_script import HANDS, GestureScript
from visavis.stimuli.motion.speaking.performance import perform
from visavis.stimuli.motion.speaking.speaker import NINE, Speaker
from visavis.stimuli.motion.speaking.synthetic_speaker import (
    HANDS_AT,
    LEXEMES_AT,
    TRANSITIONS,
    Planted,
    synthetic_speaker,
    synthetic_take,
)
from visavis.stimuli.motion.synthesis.gap_filling import Hold, best_segment, fill_gap
from visavis.stimuli.motion.synthesis.phrase_posture import CLASSES, Part

MIN_P = 1e-3
MIN_CASES = 50
PARTS: tuple[Part, ...] = ("com", "yaw")
FEET = ("left_foot", "right_foot", "left_toes", "right_toes")


@dataclass
class Found:
    """Everything that was measured; `cpu_s` is what learning the speaker took."""

    minutes: float
    phrases: int
    cpu_s: float
    transition_off: float
    confidence_off: float
    rules_compared: int
    delay_off_s: float
    least_p_chain: float
    least_p_mixture: float
    perform_cpu_s: float
    search_ms: float
    feet_mm: float
    ends_off: float
    jump: float
    greatest_jump: float
    is_same_again: bool

    @property
    def rows(self) -> list[Row]:
        """Every figure beside its limit."""
        return [
            Row("synthetic speaker made and learnt", self.cpu_s, "CPU s"),
            Row("worst transition off by", self.transition_off, "", 0.05),
            Row(
                f"worst confidence of {self.rules_compared} rules with {MIN_CASES} cases off by",
                self.confidence_off,
                "",
                0.10,
            ),
            Row("worst delay off by", self.delay_off_s, "s", 0.03),
            Row("least p against transitions alone", self.least_p_chain, "", MIN_P, at_least=True),
            Row("least p against their mixture", self.least_p_mixture, "", MIN_P, at_least=True),
            Row("a minute of body from a script", self.perform_cpu_s, "CPU s", 0.5),
            Row("F: one gap searched for", self.search_ms, "CPU ms", 50.0),
            Row("planted feet move by", self.feet_mm, "mm", 1e-6),
            Row("filled gaps off their ends by", self.ends_off, "", 1e-9),
            Row("greatest velocity jump of all junctions", self.greatest_jump, "× p95", 1.2),
            Row("velocity jump of 95 in 100 junctions", self.jump, "× p95", 1.2),
            Row("same seed, same bytes", int(self.is_same_again), "", 1, at_least=True),
        ]


def transition_off(speaker: Speaker) -> float:
    """Return how far the worst learnt transition is from the planted one."""
    return max(
        float(np.abs(speaker.habits.chain(part, before) - TRANSITIONS[part][row]).max())
        for part in PARTS
        for row, before in enumerate(CLASSES[part])
    )


def planted_confidence(part: Part, by: str, hand: str, lexeme: str) -> Vector:
    """Return the share of each class that was planted for a rule's gestures, shape (3,)."""
    # How often each class is there in the long run.
    values, vectors = np.linalg.eig(TRANSITIONS[part].T)
    often = np.real(vectors[:, np.argmax(np.real(values))])
    shares = often / often.sum()
    if part == "com" and "H" in by:
        column = list(HANDS.values()).index(hand)
        shares = shares * np.array([HANDS_AT[c][column] for c in CLASSES["com"]])
    if part == "yaw" and "L" in by:
        shares = shares * np.array([lexeme in LEXEMES_AT[c] for c in CLASSES["yaw"]])
    planted: Vector = shares / shares.sum()
    return planted


def confidence_off(speaker: Speaker) -> tuple[float, int]:
    """Return how far the worst confidence with enough cases is from the planted one, and of how
    many rules.
    """
    off: dict[tuple[str, ...], float] = {}
    for part in PARTS:
        for hand, lexeme in {(p.hand, p.lexeme) for p in speaker.habits.phrases}:
            for rule in speaker.habits.rules(part, hand, lexeme):
                if rule.with_gesture >= MIN_CASES:
                    gesture = {"H": hand, "L": lexeme, "HL": f"{hand} {lexeme}"}[rule.by]
                    name = (part, rule.posture, gesture)
                    shares = planted_confidence(part, rule.by, hand, lexeme)
                    off[name] = abs(rule.confidence - shares[CLASSES[part].index(rule.posture)])
    return max(off.values(), default=0.0), len(off)


def delay_off_s(speaker: Speaker, planted: Planted) -> float:
    """Return how far the worst mean delay is from the planted one."""
    return max(
        abs(speaker.com_delay.mean_s - planted.com_after_s),
        abs(speaker.yaw_delay.mean_s + planted.yaw_before_s),
        abs(speaker.trunk_delay.mean_s - planted.trunk_after_s),
    )


def least_p(speaker: Speaker, script: GestureScript, seeds: int) -> float:
    """Return the least p of drawn postures against the probabilities they were drawn with."""
    counts = speaker.counts()
    is_there = np.array([posture in counts for posture in NINE], dtype=np.float64).reshape(3, 3)
    least = 1.0
    for seed in range(seeds):
        drawn = sample_postures(speaker, script, np.random.default_rng((seed, 60)))
        seen = {part: np.zeros((3, 3)) for part in PARTS}
        expected = {part: np.zeros((3, 3)) for part in PARTS}
        before = ("centre", "front")
        for phrase, posture in zip(script.phrases, drawn, strict=True):
            joint = speaker.habits.joint(*before, HANDS[phrase.hand], phrase.lexeme)
            joint = joint.reshape(3, 3) * is_there
            joint /= joint.sum()
            for axis, part in enumerate(PARTS):
                row = CLASSES[part].index(before[axis])
                seen[part][row, CLASSES[part].index(posture[axis])] += 1
                expected[part][row] += joint.sum(axis=1 - axis)
            before = posture
        for part in PARTS:
            square = ((seen[part] - expected[part]) ** 2 / expected[part]).sum()
            least = min(least, float(chi2.sf(square, 6)))
    return least


def search_ms(speaker: Speaker, gaps: int = 30) -> float:
    """Return the CPU time of one search over the whole corpus."""
    source = speaker.takes[0].track.hips[:, [0, YAW]] / speaker.scale
    rng = np.random.default_rng(7)
    begun_s = cpu_time_s()
    for _ in range(gaps):
        before, after = rng.normal(size=(2, WINDOW + 1, 2))
        best_segment(source, before, after, int(rng.integers(5, 40)), WINDOW)
    return 1000 * (cpu_time_s() - begun_s) / gaps


def ends_off(speaker: Speaker) -> float:
    """Return how far filled gaps are off both ends: what F and I give exactly there."""
    rng = np.random.default_rng(8)
    source = speaker.takes[0].track.hips
    worst = 0.0
    for _ in range(50):
        before, after = rng.normal(size=(2, 3, 6))
        gap, start = int(rng.integers(1, 60)), int(rng.integers(0, len(source) - 70))
        piece = fill_gap(source, before, after, gap, start)
        own = source[start + 1 : start + gap + 1]
        # The offset is a straight line: prolonged by a frame it must meet the ends.
        offset = np.concatenate([np.zeros((0, 6)), piece - own])
        share = np.arange(1, gap + 1) / (gap + 1)
        slope = (after[0] - source[start + gap + 1]) - (before[-1] - source[start])
        straight = (before[-1] - source[start]) + share[:, None] * slope
        worst = max(worst, float(np.abs(offset - straight).max()))
        hold = Hold(before[-1, 0], before[-1, 1], after[0, 0], 0.1 + float(rng.random()))
        at = hold.at(np.array([0.0, hold.gap_s]))
        worst = max(worst, abs(at[0] - before[-1, 0]), abs(at[1] - after[0, 0]))
    return worst


def jumps(speaker: Speaker, scripts: list[GestureScript], fills: tuple[Fill, ...]) -> Vector:
    """Return by how much velocity jumps at every junction of the scripts' plans."""
    all_jumps = []
    for seed, script in enumerate(scripts):
        for fill in fills:
            plan = plan_body(speaker, script, fill, seed)
            speed = np.diff(plan.hips[:, [0, YAW]], axis=0) * RATE_HZ
            speed /= speaker.scale * speaker.fast
            all_jumps += [
                np.abs(np.diff(speed[max(0, k - 2) : k + 1], axis=0)).max() for k in plan.junctions
            ]
    return np.array(all_jumps)


def measured(minutes: float, seeds: int) -> Found:
    """Return everything that is measured."""
    synthetic_speaker(99, 0.5)  # compiles
    begun_s = cpu_time_s()
    speaker, planted = synthetic_speaker(1, minutes)
    learnt_s = cpu_time_s() - begun_s
    scripts = [synthetic_take(70 + seed, 1.0)[1] for seed in range(min(seeds, 8))]
    build = build_of_skeleton(canonical_skeleton(1.68))

    def clip_of(seed: int) -> Clip:
        return perform(scripts[0], speaker, build, fill="F", seed=seed, rate_hz=30.0)

    clip_of(0)
    begun_s = cpu_time_s()
    clips = [clip_of(seed) for seed in (1, 2, 3)]
    perform_s = (cpu_time_s() - begun_s) / len(clips)
    feet = placed_joints(clips[0], clips[0].frame_times_s).position_m[
        :, [build.skeleton.index(joint) for joint in FEET]
    ]
    again = clip_of(1)
    all_jumps = jumps(speaker, scripts, ("F", "I"))
    confidence, rules = confidence_off(speaker)
    return Found(
        minutes=minutes,
        phrases=len(planted.postures),
        cpu_s=learnt_s,
        transition_off=transition_off(speaker),
        confidence_off=confidence,
        rules_compared=rules,
        delay_off_s=delay_off_s(speaker, planted),
        least_p_chain=least_p(replace(speaker, beta=0.0), speaker.takes[0].script, seeds),
        least_p_mixture=least_p(speaker, speaker.takes[0].script, seeds),
        perform_cpu_s=perform_s,
        search_ms=search_ms(speaker),
        feet_mm=1000 * float(np.ptp(feet, axis=0).max()),
        ends_off=ends_off(speaker),
        jump=float(np.quantile(all_jumps, 0.95)),
        greatest_jump=float(all_jumps.max()),
        is_same_again=again.orientation_wxyz.tobytes() == clips[0].orientation_wxyz.tobytes(),
    )


def main(arguments: list[str]) -> int:
    """Print what was measured beside its limits."""
    parser = argparse.ArgumentParser(prog="benchmarks.speaking_body", description=__doc__)
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    found = measured(options.minutes, options.seeds)
    return show(found.rows, as_json=options.json)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
