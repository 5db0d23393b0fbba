"""Sort the 27 walks of set B without their names, and count what was sorted right.

    python -m benchmarks.blind_walks --out FOLDER
    python -m benchmarks.blind_walks --out FOLDER --answers sorted.csv

The first writes three sheets of nine walks in an order of chance, each at five moments .2 s
apart, and the key (`key.csv`, not to be looked at). Whoever sorts writes a table
`number,emotion,speed`, in which each emotion occurs at each speed once. The second says how many
are in the right row (emotion), in the right column (speed), and in either.
"""

import argparse
import csv
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image, ImageDraw

from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg, quat_multiply, rotate
from visavis.stage.card.context import offscreen_context
from visavis.stage.renderer import ON_PROCESSOR, Renderer
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.picture import Camera, PosedPeople
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.live_figures import LiveFigures
from visavis.stimuli.text_font import font_for
from visavis.study.live import walks
from visavis.study.moulding import FILMED_M, Walking

SIZE_PX: Final = (150, 230)
MOMENTS_S: Final = (0.0, 0.2, 0.4, 0.6, 0.8)
TURN_DEG: Final = 235.0
TAN_UP: Final = 0.28


def main() -> None:
    """Write the sheets, or count answers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--answers", type=Path, default=None)
    options = parser.parse_args()
    if options.answers is None:
        write_sheets(options.out)
        return
    rows, columns, either = count_right(options.out / "key.csv", options.answers)
    print(f"of 27: {rows} in the right row, {columns} in the right column, {either} in either")


def count_right(key: Path, answers: Path) -> tuple[int, int, int]:
    """Return how many walks are in their row, in their column, and in one of them."""
    truth, sorted_as = (
        {row["number"]: (row["emotion"], row["speed"]) for row in csv.DictReader(file.open())}
        for file in (key, answers)
    )
    right = np.array([[a == b for a, b in zip(truth[n], sorted_as[n], strict=True)] for n in truth])
    return int(right[:, 0].sum()), int(right[:, 1].sum()), int(right.any(axis=1).sum())


def write_sheets(out: Path) -> None:
    """Draw all walks in an order of chance."""
    out.mkdir(parents=True, exist_ok=True)
    examples = walks("set_b")
    order = np.random.default_rng().permutation(len(examples))
    names = [examples.names[i].rsplit("_", 1) for i in order]
    rows = [f"{k},{emotion},{speed}\n" for k, (emotion, speed) in enumerate(names, 1)]
    (out / "key.csv").write_text("number,emotion,speed\n" + "".join(rows), "utf-8")
    wide = TAN_UP * SIZE_PX[0] / SIZE_PX[1]
    eye = Pose(np.array([0.0, 1.0, 1.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    camera = Camera(eye, -wide, wide, -TAN_UP, TAN_UP)
    turn = quat_from_yaw_pitch_deg(TURN_DEG)
    scene = LiveFigures("live", (), characters=("female_01",))
    strips = []
    with Renderer(offscreen_context(), quality=ON_PROCESSOR) as renderer:
        for number, i in enumerate(order, 1):
            walking = Walking(examples, np.eye(len(examples))[i], 0)
            tiles = []
            for moment_s in MOMENTS_S:
                root_m, turns = walking.at(round(moment_s * 1e9))
                turns = np.concatenate([quat_multiply(turn, turns[0])[None], turns[1:]])
                place_m = rotate(turn, root_m) + np.array([0.0, 0.0, -FILMED_M])
                people = PosedPeople(place_m[None], turns[None], np.zeros((1, 6)))
                frame = SceneFrame(scene, 0, np.zeros((0, 3)), np.zeros(0), people)
                tiles.append(renderer.image(picture_of(frame), camera, SIZE_PX)[..., :3])
            strip = Image.fromarray(np.concatenate(tiles, axis=1))
            ImageDraw.Draw(strip).text((4, 4), str(number), (200, 0, 0), font_for("1", 28))
            strips.append(strip)
    width, height = strips[0].size
    for s in range(3):
        sheet = Image.new("RGB", (3 * width, 3 * height))
        for k, strip in enumerate(strips[9 * s : 9 * s + 9]):
            sheet.paste(strip, ((k % 3) * width, (k // 3) * height))
        sheet.save(out / f"walks_{s + 1}.png")


if __name__ == "__main__":
    main()
