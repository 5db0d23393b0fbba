"""Put OpenVR drivers on the simulated runtime, or on a capture of it, in virtual time."""

import contextlib

import pytest

from tests.devices.bodies import FixatingBody
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.native_build import find_compiler
from visavis.devices.sim.openvr.runtime import SimulatedVrRuntime
from visavis.lab.clock import NS_PER_S, SimClock


def needs_stub():
    pytest.importorskip("openvr", reason="pip install openvr")
    if find_compiler() is None:
        pytest.skip("the simulated OpenVR runtime needs a C compiler: apt-get install gcc")


@contextlib.contextmanager
def simulated_runtime(*faults, clock=None, body=None, **options):
    needs_stub()
    clock = clock if clock is not None else SimClock()
    body = body if body is not None else FixatingBody()
    schedule = FaultSchedule.from_config(faults)
    with SimulatedVrRuntime(body, clock, faults=schedule, **options) as runtime:
        yield runtime, clock


def passer(clock):
    return lambda seconds: clock.sleep_until_ns(clock.now_ns() + round(seconds * NS_PER_S))
