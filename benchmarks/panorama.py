"""Measure the work that a panorama of 8k takes: once, and in every frame.

    python -m benchmarks.panorama [--width 8192] [--frames 120] [--json]

Own work is what Visavis does in a frame: the picture of the scene, its checksum, and the calls to
the card for both eyes, into pictures so small that filling them counts for nothing. Filling 1920 by
1080 pixels is the card's work; without one, Mesa's on the processor. Limit: 3 ms of own work.
"""

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks.table import Row, show
from visavis.lab.clock import StopWatch
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg
from visavis.stage.card.targets import EyeTarget
from visavis.stage.drawn_stage import default_views, eye_camera
from visavis.stage.frame_truth import picture_crc32
from visavis.stage.renderer import Quality, Renderer
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.flat import Panorama
from visavis.stimuli.panorama_pixels import panorama_pixels
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.flat import DRESSED_BY, FlatScene

FULL_PX = (1920, 1080)
SMALL_PX = (16, 16)
LIMIT_MS = 3.0


def draw(renderer: Renderer, scene: FlatScene, target: EyeTarget, index: int) -> tuple[float, int]:
    """Draw a frame for both eyes, the head turned a little; return the ms it took, and a checksum
    that needs the whole picture.
    """
    head = Pose(np.zeros(3), quat_from_yaw_pitch_deg(3.0 * index))
    watch = StopWatch()
    frame = SceneFrame(scene, index, np.zeros((0, 3)), np.zeros(0), turned_deg=(index, 0.0))
    picture = picture_of(frame)
    crc = picture_crc32(picture)
    cameras = [eye_camera(head, view) for view in default_views()]
    renderer.draw(picture, cameras, [target, target])
    renderer.context.finish()
    return 1000 * watch.elapsed_s(), crc


def main(argv: Sequence[str]) -> int:
    """Print the times; return 1 where the limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--width", type=int, default=8192)
    parser.add_argument("--frames", type=int, default=120)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(argv)
    size_px = options.width, options.width // 2
    with tempfile.TemporaryDirectory() as name:
        noise = np.random.default_rng(1).integers(0, 256, (64, 128, 3), dtype=np.uint8)
        whole = Image.fromarray(noise).resize(size_px, Image.Resampling.BICUBIC)
        whole.save(Path(name) / "a.jpg", quality=92)
        panorama = Panorama("a.jpg")
        watch = StopWatch()
        panorama_pixels(panorama, Path(name))
        decoded_s = watch.elapsed_s()
        scene = FlatScene("flat", (), dressed_by=DRESSED_BY, panorama=panorama, folder=Path(name))
        with Renderer(quality=Quality(samples=0)) as renderer:
            card = str(renderer.context.info["GL_RENDERER"])
            small, full = (EyeTarget(renderer.context, px, 0) for px in (SMALL_PX, FULL_PX))
            sent_ms, _ = draw(renderer, scene, small, 0)
            own_ms = [draw(renderer, scene, small, k)[0] for k in range(options.frames)]
            full_ms = [
                draw(renderer, scene, full, k)[0] for k in range(max(3, options.frames // 8))
            ]
            small.release()
            full.release()
    rows = [
        Row(f"decoded once, {size_px[0]} × {size_px[1]} pixels", decoded_s, "s"),
        Row("sent to the card once, with smaller copies", sent_ms, "ms"),
        Row("own work of a frame, median", float(np.median(own_ms)), "ms", LIMIT_MS),
        Row("own work of a frame, 99 %", float(np.percentile(own_ms, 99)), "ms"),
        Row(
            f"filled, two eyes of {FULL_PX[0]} × {FULL_PX[1]}: {card}",
            float(np.median(full_ms)),
            "ms",
        ),
    ]
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
