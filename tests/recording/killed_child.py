"""Record trials for ever, saying each that was acknowledged; the test kills this process.

python -m tests.recording.killed_child DATA_ROOT threaded|inline
"""

import sys
from itertools import count
from pathlib import Path

from tests.recording.sessions import PROBE, probe_batch, probe_manifest
from visavis.lab.clock import NS_PER_S, SimClock, SystemClock
from visavis.recording.folder import create_session
from visavis.recording.writer import Recorder


def main(data_root: Path, threaded: bool) -> None:
    """Record until killed."""
    clock = SystemClock() if threaded else SimClock()
    with create_session(data_root, probe_manifest()) as folder:
        recorder = Recorder(
            folder.begin_part(clock),
            clock,
            threaded=threaded,
            max_batch_ns=NS_PER_S // 100,
            is_simulated=True,
        )
        recorder.declare(PROBE)
        for trial in count():
            for first in range(trial * 60, (trial + 1) * 60, 2):
                recorder.append(probe_batch(first, 2))
            recorder.event("trial_end", 0, trial_id=trial)
            recorder.trial({"trial_id": trial})
            sys.stdout.write(f"{trial}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2] == "threaded")
