"""Two devices of a kind: refused by their names, or chosen, on every wire that looks for any."""

from types import SimpleNamespace

import pytest

from tests.devices.bodies import FixatingBody
from tests.devices.body_rigs import WalkingBody
from tests.devices.wire_ends.hid_tracker import FakeHidapi
from visavis.devices.drivers.buttons.hid import HidButtonLink
from visavis.devices.drivers.hid_gaze.reports import HidReports
from visavis.devices.drivers.links.usb import HidLink
from visavis.devices.drivers.lsl import inlet
from visavis.devices.drivers.lsl.inlet import LslInlet
from visavis.devices.drivers.natnet.driver import NatNet
from visavis.devices.drivers.natnet.spec import MOTIVE_BONES
from visavis.devices.drivers.xsens import codec as xsens
from visavis.devices.drivers.xsens.driver import XsensMvn
from visavis.devices.one_of_a_kind import the_only, the_only_hid
from visavis.devices.sim.hid_gaze import HidGazeSimulator
from visavis.devices.sim.natnet import NatNetSimulator
from visavis.devices.transports import MemoryTransport, Message
from visavis.lab.clock import SimClock
from visavis.lab.errors import DeviceNotFound, DeviceTimeout

PAD = {
    "path": b"/dev/hidraw3",
    "vendor_id": 0x045E,
    "product_id": 0x028E,
    "usage_page": 1,
    "usage": 5,
    "interface_number": 0,
    "serial_number": "",
    "product_string": "Gamepad",
}


def hidapi(*rows):
    return SimpleNamespace(
        enumerate=lambda *ids: list(rows),
        device=lambda: SimpleNamespace(open_path=lambda path: None),
    )


def test_refusal_names_all_that_fit_and_says_what_to_do():
    with pytest.raises(DeviceNotFound, match=r"2 pads fit: a, b; unplug one"):
        the_only(["b", "a"], str, "pads", "unplug one")


@pytest.mark.parametrize(
    "second",
    [
        {"serial_number": "B", "path": b"/dev/hidraw4"},
        {"path": b"/dev/hidraw4"},  # as many gamepads, without a serial number
        {"product_id": 1, "path": b"/dev/hidraw4"},
    ],
)
def test_two_gamepads_are_refused(second):
    link = HidButtonLink(SimClock(), library=hidapi(PAD, {**PAD, **second}))

    with pytest.raises(DeviceNotFound, match=r"2 gamepads or button boxes fit: Gamepad 045e"):
        link.open(1.0)


@pytest.mark.parametrize(
    "second",
    [
        {"interface_number": 1, "path": b"/dev/hidraw4"},
        {"usage": 4},  # another collection of the same interface
    ],
)
def test_two_parts_of_one_device_are_one(second):
    assert the_only_hid([PAD, {**PAD, **second}], "gamepads")["path"] == b"/dev/hidraw3"


def test_two_bands_of_one_product_are_refused_and_a_serial_chooses():
    rows = [{**PAD, "serial_number": serial, "path": serial.encode()} for serial in "AB"]
    with pytest.raises(DeviceNotFound, match=r"2 HID bands fit: .* A, .* B; give serial_number"):
        HidLink(SimClock(), vid=1, pid=2, library=hidapi(*rows)).open(1.0)

    assert the_only_hid([row for row in rows if row["serial_number"] == "B"], "")["path"] == b"B"


def test_two_eye_trackers_are_refused():
    clock = SimClock()
    library = FakeHidapi(HidGazeSimulator(FixatingBody(), clock=clock, seed=1), clock)
    (tracker,) = (row for row in library.enumerate() if row["usage_page"] == 0x12)
    other = {**tracker, "serial_number": "SIM13", "path": b"/dev/hidraw-other"}
    library.enumerate = lambda: [tracker, other]

    with pytest.raises(DeviceNotFound, match=r"2 HID eye trackers fit: .*SIM12, .*SIM13"):
        HidReports("", clock, library=library).open(1.0)


class Lsl:
    """What of pylsl the inlet calls, with these streams on the network."""

    class TimeoutError(Exception):
        pass

    class LostError(Exception):
        pass

    def __init__(self, *streams):
        self.streams = [
            SimpleNamespace(
                name=lambda name=name: name,
                source_id=lambda source=source: source,
                hostname=lambda: "lab",
                uid=lambda number=number: str(number),
            )
            for number, (name, source) in enumerate(streams)
        ]
        self.taken = []

    def resolve_bypred(self, predicate, minimum, timeout):
        return self.streams

    def StreamInlet(self, stream, **options):  # noqa: N802 - pylsl's name
        self.taken.append(stream.source_id())
        xml = SimpleNamespace(as_xml=lambda: "<info/>")
        return SimpleNamespace(
            open_stream=lambda timeout: None,
            info=lambda timeout: xml,
            close_stream=lambda: None,
        )


def test_two_streams_of_a_type_are_refused_by_name_and_source(monkeypatch):
    lsl = Lsl(("gaze A", "a1"), ("gaze B", "b1"))
    monkeypatch.setattr(inlet, "lsl_library", lambda: lsl)

    with pytest.raises(DeviceNotFound, match=r"2 LSL streams of type Gaze fit: 'gaze A' of lab"):
        LslInlet(SimClock()).open(1.0)
    assert not lsl.taken


def test_two_streams_of_one_source_are_two_where_their_names_differ(monkeypatch):
    lsl = Lsl(("gaze", "tracker"), ("openness", "tracker"))
    monkeypatch.setattr(inlet, "lsl_library", lambda: lsl)

    with pytest.raises(DeviceNotFound, match=r"'gaze' of lab .*'openness' of lab"):
        LslInlet(SimClock()).open(1.0)


def test_stream_that_was_open_is_taken_again_though_another_appeared(monkeypatch):
    lsl = Lsl(("gaze A", "a1"))
    monkeypatch.setattr(inlet, "lsl_library", lambda: lsl)
    wire = LslInlet(SimClock())
    wire.open(1.0)
    lsl.streams = [*Lsl(("gaze B", "b1")).streams, *lsl.streams]
    wire.open(1.0)
    wire.close()

    assert lsl.taken == ["a1", "a1"]


def test_one_source_that_answers_twice_is_one(monkeypatch):
    monkeypatch.setattr(inlet, "lsl_library", lambda: Lsl(("gaze", "a1"), ("gaze", "a1")))
    wire = LslInlet(SimClock())
    wire.open(1.0)
    wire.close()


def test_no_stream_is_still_a_stream_that_was_not_found(monkeypatch):
    monkeypatch.setattr(inlet, "lsl_library", lambda: Lsl())

    with pytest.raises(DeviceTimeout, match="no stream with type='Gaze'"):
        LslInlet(SimClock()).open(1.0)


def test_two_skeletons_of_motive_are_refused_and_a_name_chooses(monkeypatch):
    bones = {("Ann", "Hip"): (1, 1), ("Bob", "Hip"): (2, 1)}
    models = SimpleNamespace(bodies={}, bones=bones)
    monkeypatch.setattr(
        "visavis.devices.drivers.natnet.codec.decode_models", lambda payload, version: models
    )
    clock = SimClock()

    def driver(**options):
        peer = NatNetSimulator(WalkingBody(), clock, seed=1, bodies=MOTIVE_BONES, skeleton="Ann")
        return NatNet("body", MemoryTransport(peer, clock), clock, **options)

    with pytest.raises(DeviceNotFound, match=r"2 skeletons in Motive fit: 'Ann', 'Bob'"):
        driver().open(2.0)
    driver(skeleton="Bob").open(2.0)


def test_two_characters_of_mvn_block_unless_one_is_chosen(monkeypatch):
    clock = SimClock()

    def characters_seen(**options):
        driver = XsensMvn("body", SimpleNamespace(kind="udp", is_simulated=True), clock, **options)
        for character in (3, 4):
            datagram = xsens.Datagram(1, 0, True, 0, character, b"")
            monkeypatch.setattr(xsens, "decode_datagram", lambda data, found=datagram: found)
            tuple(driver._decode(Message(0, (b"",))))
        return [fault.message for fault in driver.check() if fault.severity == "blocking"]

    assert characters_seen() == ["MVN streams characters 3 and 4, and none was chosen"]
    assert not characters_seen(character=4)
