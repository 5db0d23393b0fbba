"""A staged scene says of frames ahead what it says frame by frame."""

from types import SimpleNamespace

import numpy as np
import pytest

from visavis.study.scenes import PassingScene, Staging, audience, person

FRAME_NS = 10**9 // 90
ONSET_NS = 5 * 10**9


def views(count):
    """Return frames in which the head sways by some centimetres."""
    t_ns = ONSET_NS + FRAME_NS * np.arange(1, count + 1)
    heads_m = np.array([0.0, 1.2, 0.0]) + 0.01 * np.cumsum(
        np.random.default_rng(2).normal(0.0, 0.1, (count, 3)), axis=0
    )
    return [
        SimpleNamespace(
            t_ns=int(t), head_valid=True, head=SimpleNamespace(position_m=m), gaze=number
        )
        for number, (t, m) in enumerate(zip(t_ns, heads_m, strict=True))
    ]


def record(view):
    return (
        None
        if view is None
        else [
            view.t_ns,
            view.gaze_direction.tolist(),
            view.eye_openness_01.tolist(),
            view.gaze_distance_m.tolist(),
        ]
    )


@pytest.mark.parametrize("eyes", ["directed", "averted"])
def test_frames_passed_together_show_what_each_would_have_shown(eyes):
    def shown(lengths):
        scene = audience(Staging(np.random.default_rng(1), 10.0), eyes=eyes)
        passing = PassingScene(scene, ONSET_NS, [])
        frames, coming = [], views(400)
        for n in lengths:
            told = coming[: n + 3]
            pictures = passing.ahead(
                [view.t_ns for view in told], np.array([v.head.position_m for v in told])
            )
            if n == 0:
                frames.append(record(passing(coming.pop(0))))
                continue
            frames += [record(pictures.after(i)) if pictures.is_new[i] else None for i in range(n)]
            passing.pass_frames(pictures, [view.gaze for view in coming[:n]])
            del coming[:n]
        return frames, passing.gazes, passing.frames

    each, gazes, count = shown([0] * 390)
    together, gazes_together, count_together = shown([0, 1, 17, 0, 40, 0, 0, 100, 3, 200, 20, 5])

    assert list(range(390)) == gazes == gazes_together
    assert 390 == count == count_together
    assert each == together
    assert 20 < sum(frame is None for frame in each) < 370


def test_a_scene_that_says_frame_by_frame_what_it_shows_tells_nothing_ahead():
    scene = person(Staging(np.random.default_rng(1), 2.0))
    told = views(5)
    heads_m = np.array([view.head.position_m for view in told])

    class Own(type(scene)):
        def frame(self, view, elapsed_ns):
            return None

    own = Own(scene.scene, scene.roles, scene.eyes)

    assert PassingScene(own, ONSET_NS).ahead([view.t_ns for view in told], heads_m) is None
    assert PassingScene(scene, ONSET_NS).ahead([v.t_ns for v in told], heads_m) is not None
