"""The machines that tests of the firmware run on, each built once."""

import pytest

from tests.devices.wire_ends.armband_machine import LockstepMachine, PythonMachine, build
from visavis.lab.errors import DeviceNotFound


@pytest.fixture(scope="session")
def built(tmp_path_factory):
    """Return the command of a machine, or skip with the sentence that says what to install."""
    known = {}

    def command(kind):
        if kind not in known:
            try:
                known[kind] = build(kind, tmp_path_factory.mktemp(kind))
            except DeviceNotFound as missing:
                known[kind] = missing
        if isinstance(known[kind], DeviceNotFound):
            pytest.skip(f"{known[kind]}; the other machines still run these tests")
        return known[kind]

    return command


@pytest.fixture(params=["simavr", "host", "python"])
def machine(request, built):
    if request.param == "python":
        made = PythonMachine()
    else:
        made = LockstepMachine(built(request.param))
    with made:
        yield made
