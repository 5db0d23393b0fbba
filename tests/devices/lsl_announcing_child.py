"""Announce a stream as a session does, say so, and stay until the standard input ends.

The first argument is what the stream's source is called, the second the lab's LSL session, empty
for LSL's own.
"""

import sys

from visavis.cli.lsl_announcer import scope_of, set_scope
from visavis.devices.contracts import HEAD
from visavis.devices.drivers.lsl.outlet import LslOutlets
from visavis.lab.clock import SystemClock
from visavis.lab.config import Sync

scope = scope_of(Sync(lsl=True, session_id=sys.argv[2], this_computer_only=bool(sys.argv[2])))
set_scope(scope)
outlets = LslOutlets(
    {"headset": (HEAD,)}, scope, SystemClock(), source=sys.argv[1], is_simulated=True
)
sys.stdout.write("announced\n")
sys.stdout.flush()
sys.stdin.read()
outlets.close()
