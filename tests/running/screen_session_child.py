"""Perform a session in a window that fills this X server's screen, with real key events.

A Gazepoint's server is on a real socket, as its vendor's program would be; whom it watches looks at
every mark that is shown. Run as `python -m tests.running.screen_session_child FOLDER`.
"""

# ruff: noqa: T201 - the folder is what the test reads
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.devices.bodies import FixatingBody
from tests.devices.wire_ends.gazepoint_host import GazepointHost
from visavis.devices.registry import OPTION_MODELS
from visavis.devices.sim.gaze.tracker_error import TrackerErrorModel
from visavis.devices.sim.gazepoint import GazepointSimulator
from visavis.lab.clock import SystemClock
from visavis.lab.config import parse_config
from visavis.lab.geometry import unit
from visavis.protocol.session.gaze_setup import TargetTiming
from visavis.protocol.session.operator import UnattendedOperator
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request

EYES_M = np.array([0.0, 1.2, 0.0])
ABOVE_M = np.array([0.0, 0.35, -2.0])
STUDY = """
from visavis import Choice, Factor, Keys, Rating, Scene, Study, dwell_on

study = Study(
    "pair", "Whom do people look at?", factors=[Factor("side", ["left", "right"])],
    repetitions=1, measures=[dwell_on("active")],
)

@study.trial
def trial(t):
    yield t.dark(0.2)
    yield t.show(Scene("two_people", active=t.side), seconds=0.7)
    yield t.key(Keys("seen", ("f", "j"), limit_s=4.0))
    yield t.ask(Rating("realism", 1, 5))
    yield t.ask(Choice("nearer", ("left", "right")))
"""
LAB = """
lab: Screen room
data_root: data
key_root: keys
display:
  show: screen
  questions: screen
  screen:
    width_m: 0.531
    height_m: 0.299
    width_px: 640
    height_px: 360
    distance_m: 0.65
    rate_hz: 30
privacy: {consent_version: "1"}
devices:
  eye_tracker: {driver: gazepoint, port: PORT}
  responses: {driver: keyboard}
"""
QUICK = TargetTiming(60, 40, 120, 500)


class Onlooker(FixatingBody):
    """Somebody in the chin rest, whose eyes meet whatever they are told to look at.

    Without a mark they look above the options of a board, which their gaze would choose.
    """

    def at(self, mark_m):
        self.point_m = ABOVE_M if mark_m is None else np.asarray(mark_m) - EYES_M
        self.direction = unit(self.point_m)


class Asked:
    """Nobody at the terminal: every question must be answered on the screen."""

    def answer(self, question_id, prompt, options):
        raise AssertionError(f"{question_id} was asked at the terminal")


def press(keys, stop):
    """Press keys in turn, as a person at the keyboard would, until told to stop."""
    while not stop.is_set():
        for key in keys:
            subprocess.run(["xdotool", "key", "--delay", "30", key], check=False)  # noqa: S607
            stop.wait(0.15)


def main(folder: Path) -> None:
    (folder / "pair.py").write_text(STUDY, "utf-8")
    clock = SystemClock()
    onlooker = Onlooker()
    # a tracker without errors of its own: what is left is what we do to its numbers
    exact = TrackerErrorModel(
        offset_deg=0.0, eye_offset_deg=0.0, gain_sd_01=0.0, white_deg=0.0, slow_deg=0.0
    )
    peer = GazepointSimulator(onlooker, seed=1, clock=clock, rate_hz=60.0, error=exact)
    stop = threading.Event()
    with GazepointHost(peer, clock) as host:
        text = LAB.replace("PORT", str(host.port))
        config = parse_config(text, folder / "lab_config.yaml", OPTION_MODELS)
        study = find_study(str(folder / "pair.py"))
        experiment = study.experiment({})
        blank = experiment.blank

        def told(mark_m):
            onlooker.at(mark_m)
            return blank(mark_m)

        object.__setattr__(experiment, "blank", told)
        request = replace(
            simulated_request(study, experiment, config, label="07", index=0, seed=1),
            clock=clock,
            operator=UnattendedOperator(),
            respondent=Asked(),
            timing=QUICK,
        )
        keys = ["j", "Right", "Return", "4"]
        presser = threading.Thread(target=press, args=(keys, stop))
        presser.start()
        try:
            print(perform_new(request))
        finally:
            stop.set()
            presser.join()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
