"""Run `perform_real` before a monitor, as `visavis sync-test --sensor PORT` does in a lab.

Real are the lab's screen, the window on this X server and the system's clock. The board is
simulated, its photodiode told the corner of what the window hands to the monitor, which reaches it
later by what is planted. Run as `python -m tests.cli.sync_test_child LATENCY_MS`.
"""

# ruff: noqa: T201 - the figures are what the test reads
import json
import sys
from pathlib import Path

import numpy as np

from visavis.cli import sync_chain
from visavis.devices.byte_links import MemoryLink
from visavis.devices.registry import OPTION_MODELS
from visavis.devices.sim.sync_room import PlantedDelay, SimulatedRoom, SyncBoardSimulator
from visavis.devices.sync.board import SyncBoard
from visavis.lab.clock import SystemClock
from visavis.lab.config import parse_config
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.stage import window

REPEATS = 5


def main(latency_ms: float) -> None:
    text = SCREEN_EXAMPLE.read_text("utf-8")
    for was, now in (("px: 1920", "px: 640"), ("px: 1080", "px: 360"), ("hz: 60", "hz: 30")):
        text = text.replace(was, now)
    lab = parse_config(text, Path("lab_config.yaml"), OPTION_MODELS)
    clock = SystemClock()
    room = SimulatedRoom(clock, np.random.default_rng(1), picture=PlantedDelay(latency_ms))
    board = SyncBoardSimulator(room, clock, np.random.default_rng(2))
    present = window.Window.present
    windows = []

    def seen(shown):
        corner = shown.context.screen.read((4, 4, 1, 1))
        middle = shown.context.screen.read((320, 180, 1, 1))
        assert max(middle) < 10, "more than the corner is lit"
        present(shown)
        room.show(max(corner) > 127, clock.now_ns())
        windows.append(shown)

    window.Window.present = seen
    sync_chain.real_sensor = lambda *_: SyncBoard(MemoryLink(board, clock), clock)
    found, asked, _ = sync_chain.perform_real(
        lab,
        clock,
        sensor_name="board",
        speaker_name="",
        band_role="",
        channels=sync_chain.DEFAULT_CHANNELS,
        repeats=REPEATS,
        progress=lambda done: None,
    )
    (one,) = found
    true_ms = (np.array(room.true_onsets_ns["picture"]) - np.array(asked.picture_ns)) / 1e6
    print(
        json.dumps(
            {
                "source": one.source,
                "modality": one.modality,
                "asked": one.asked,
                "answered": one.answered,
                "errors_ms": (np.array(one.delays_ms) - true_ms).tolist(),
                "windows": len({id(shown) for shown in windows}),
                "is_closed": windows[-1].closed,
            }
        )
    )


if __name__ == "__main__":
    main(float(sys.argv[1]))
