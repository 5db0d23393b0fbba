"""`visavis run` on a screen, by the command itself: a head that moves, real drivers, real keys.

The operator is whoever writes to standard input, which is a terminal. A Gazepoint's server is on a
real socket; whom it watches sways before the monitor and looks at every mark that is shown. An
amplifier's program sends EEG by LSL's own library. Run as
`python -m tests.cli.screen_command_child FOLDER`.
"""

import json
import math
import os
import sys
import threading
from functools import partial
from pathlib import Path

import numpy as np
import pylsl

from tests.devices.bodies import EYE_X_M
from tests.devices.wire_ends.gazepoint_host import GazepointHost
from tests.running.screen_session_child import LAB, QUICK, STUDY, Onlooker, press
from visavis.cli.commands import session
from visavis.cli.main import app
from visavis.devices.sim.gaze.tracker_error import TrackerErrorModel
from visavis.devices.sim.gazepoint import GazepointSimulator
from visavis.lab.clock import NS_PER_S, SystemClock
from visavis.lab.geometry import unit
from visavis.study.experiment import StudyExperiment

SWAY_M, SWAY_S = (0.05, 0.02, 0.06), 30.0


def swayed_m(t_ns):
    """Where the middle of both eyes is, as seen from the viewing place."""
    share = math.sin(2 * math.pi * t_ns / NS_PER_S / SWAY_S)
    return tuple(share * reach for reach in SWAY_M)


class Swaying(Onlooker):
    """Somebody without a chin rest, whose eyes meet the marks from wherever they are."""

    def eyes(self, t_ns):
        values = super().eyes(t_ns)
        for i, at in enumerate(t_ns.tolist()):
            for name, side in (("left", -EYE_X_M), ("right", EYE_X_M)):
                place_m = np.array(swayed_m(at)) + side
                values[f"{name}_direction_head"][i] = unit(self.point_m - place_m)
        return values


MARKS = "marks.json"
"""What the eye tracker's server was annotated with."""
EEG_HZ, CHANNELS = 128, ("Fz", "Cz", "Pz", "Oz")


def amplify(name, clock, stop):
    """Send EEG as an amplifier's program does: a sine of 10 Hz, 20 uV, in every channel."""
    info = pylsl.StreamInfo(name, "EEG", len(CHANNELS), EEG_HZ, pylsl.cf_float32, name)
    channels = info.desc().append_child("channels")
    for label in CHANNELS:
        one = channels.append_child("channel")
        one.append_child_value("label", label).append_child_value("unit", "microvolts")
    outlet, sent = pylsl.StreamOutlet(info), 0
    begin_ns, begin_s = clock.now_ns(), pylsl.local_clock()
    while not stop.is_set():
        level_uv = 20 * math.sin(2 * math.pi * 10 * sent / EEG_HZ)
        outlet.push_sample([level_uv] * len(CHANNELS), begin_s + sent / EEG_HZ)
        sent += 1
        clock.sleep_until_ns(begin_ns + round(sent / EEG_HZ * NS_PER_S))


def main(folder: Path) -> None:
    (folder / "pair.py").write_text(STUDY, "utf-8")
    clock, onlooker = SystemClock(), Swaying()
    exact = TrackerErrorModel(
        offset_deg=0.0, eye_offset_deg=0.0, gain_sd_01=0.0, white_deg=0.0, slow_deg=0.0
    )
    peer = GazepointSimulator(
        onlooker, seed=1, clock=clock, rate_hz=60.0, error=exact, moved_m=swayed_m
    )
    blank = StudyExperiment.blank

    def told(experiment, mark_m):
        onlooker.at(mark_m)
        return blank(experiment, mark_m)

    StudyExperiment.blank = told  # the onlooker sees the marks
    session.Request = partial(session.Request, timing=QUICK)  # targets stand for less time
    stop = threading.Event()
    with GazepointHost(peer, clock) as host:
        text = LAB.replace("PORT", str(host.port)).replace(
            "    rate_hz: 30\n", "    rate_hz: 30\n    head: tracked\n"
        )
        amplifier = f"amplifier {os.getpid()}"
        text += f'  eeg: {{driver: lsl_stream, stream_type: EEG, stream_name: "{amplifier}"}}\n'
        (folder / "lab_config.yaml").write_text(text, "utf-8")
        os.chdir(folder)
        app(["participant", "add", "./pair.py", "7", "--consent", "1"], standalone_mode=False)
        keys = ["j", "Right", "Return", "4"]
        around = (
            threading.Thread(target=press, args=(keys, stop)),
            threading.Thread(target=amplify, args=(amplifier, clock, stop)),
        )
        for thread in around:
            thread.start()
        try:
            app(["run", "./pair.py", "--participant", "07"], standalone_mode=False)
        finally:
            stop.set()
            for thread in around:
                thread.join()
            (folder / MARKS).write_text(json.dumps(list(peer.annotations)), "utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
