"""bHaptics by the maker's SDK2: calls, the link on a stand-in, and the genuine package."""

import contextlib
import json
import socket
import sys
import types

import pytest

from tests.devices.band_makers import bhaptics_sdk
from visavis.devices.contracts import DeviceState
from visavis.devices.drivers.bands import bhaptics_sdk as sdk_link
from visavis.devices.drivers.bands.bhaptics_sdk_codec import BhapticsSdkLanguage, answer
from visavis.devices.drivers.bands.language import Condition, Ready, Refusal
from visavis.lab.clock import NS_PER_S, SystemClock
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceNotFound

CLOCK = SystemClock()
ON = (1.0, 0.5, 0.0, 0.25)

# What bhaptics-python 0.2.0 sent for `play_dot(1, 100, [100, 0, 50, 0, 0, 10])` and what it gave
# back for `get_device_info_json()` when a Player's port told one sleeve, on 28 November 2026.
SENT_BY_THE_PACKAGE = (
    '{"requestId":1217,"position":1,"durationMillis":100,'
    '"motorValues":[100,0,50,0,0,10],"deviceIndex":-1}'
)
DEVICES_BY_THE_PACKAGE = (
    '[{"position": 1, "deviceName": "Tactosy L", "address": "aa", "connected": true, '
    '"paired": true, "battery": 77, "audioJackIn": false, "vsm": 0}]'
)


def test_a_frame_is_the_call_whose_message_the_package_sent():
    (message,) = BhapticsSdkLanguage("ForearmL", (0, 2, 5)).drive((1.0, 0.5, 0.1), 5000)
    sent = json.loads(SENT_BY_THE_PACKAGE)

    assert json.loads(message) == {
        "call": "play_dot",
        "arguments": [
            sent["position"],
            sent["durationMillis"],
            sent["motorValues"],
            sent["deviceIndex"],
        ],
    }


def test_a_unit_is_read_as_the_package_tells_it():
    language = BhapticsSdkLanguage("ForearmL")
    told = language.feed(answer("get_device_info_json", json.loads(DEVICES_BY_THE_PACKAGE)))

    assert told == [Ready("Tactosy L", "aa"), Condition(battery_01=0.77, is_worn=True)]


def test_the_units_other_arm_is_not_this_one():
    told = BhapticsSdkLanguage("ForearmR").feed(
        answer("get_device_info_json", json.loads(DEVICES_BY_THE_PACKAGE))
    )
    assert told == [Ready(), Condition(is_worn=False)]


def test_a_frame_that_is_not_taken_is_a_refusal():
    (refusal,) = BhapticsSdkLanguage().feed(answer("play_dot", -1))
    assert isinstance(refusal, Refusal)
    assert "look at the Player" in refusal.remedy


class StandIn(types.ModuleType):
    """The functions of the package that are called, writing down how."""

    def __init__(self):
        super().__init__("bhaptics_python")
        self.calls = []
        self.is_there = True

    async def registry_and_initialize(self, app_id, api_key, definitions):
        self.calls.append(("init", app_id, api_key, definitions))
        return self.is_there

    async def get_device_info_json(self):
        return DEVICES_BY_THE_PACKAGE

    async def play_dot(self, *arguments):
        self.calls.append(("play", *arguments))
        return 100 + sum(kind == "play" for kind, *_ in self.calls)

    async def stop_by_request_id(self, request):
        self.calls.append(("stop", request))

    async def close(self):
        self.calls.append(("close",))


@pytest.fixture
def package(monkeypatch):
    stand_in = StandIn()
    monkeypatch.setitem(sys.modules, "bhaptics_python", stand_in)
    return stand_in


@pytest.fixture
def port(key_file):
    """A port at which a Player seems to listen."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        yield listening


@pytest.fixture
def key_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "key.txt").write_text("key\n", "utf-8")


def link_to(listening, session, app="app"):
    player = listening.getsockname()
    return sdk_link.BhapticsSdkLink(
        app, "key.txt", CLOCK, remedy="start it", session=session, player=player
    )


def test_a_frame_ends_the_one_before_it_and_silence_ends_the_last(package, port):
    driver = bhaptics_sdk("arm", CLOCK, link=link_to(port, sdk_link.PlayerSession()))
    driver.open(2.0)
    driver.start(lambda batch: None)
    driver.set_amplitudes(ON, 10_000)
    driver.poll(0.0)
    driver.silence()
    driver.close()

    assert package.calls[0] == ("init", "app", "key", "")
    first = ("play", 1, 100, [100, 0, 50, 0, 0, 25], -1)
    assert package.calls[1:3] == [first, ("stop", 101)]
    assert package.calls[-1] == ("close",)
    assert driver.info.model == "Tactosy L"
    assert driver.health().battery_01 == 0.77


def test_two_bands_share_the_packages_one_connection(package, port):
    session = sdk_link.PlayerSession()
    left, right = link_to(port, session), link_to(port, session)
    left.open(1.0)
    right.open(1.0)
    left.close()
    assert [kind for kind, *_ in package.calls] == ["init"]
    right.close()
    assert [kind for kind, *_ in package.calls] == ["init", "close"]


def test_two_applications_at_once_are_refused(package, port):
    session = sdk_link.PlayerSession()
    left = link_to(port, session)
    left.open(1.0)
    with pytest.raises(DeviceError, match="one application at a time"):
        link_to(port, session, "other").open(1.0)
    left.close()


def test_a_player_that_went_is_found_though_the_package_goes_on_numbering(package, port):
    link = link_to(port, sdk_link.PlayerSession())
    link.open(1.0)
    port.close()
    with pytest.raises(DeviceDisconnected, match="no bHaptics Player answers"):
        read_for(link, 5.0)
    link.close()


def read_for(link, seconds):
    end_ns = CLOCK.now_ns() + round(seconds * NS_PER_S)
    while CLOCK.now_ns() < end_ns:
        link.read(0.1)


def test_a_key_that_the_player_does_not_take_is_named(package, port):
    package.is_there = False
    with pytest.raises(DeviceNotFound, match="no bHaptics Player answers"):
        link_to(port, sdk_link.PlayerSession()).open(1.0)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({}, "needs an application's app_id, and api_key_file"),
        ({"app_id": "a", "api_key_file": "nowhere.txt"}, "cannot be read from nowhere.txt"),
    ],
)
def test_missing_application_or_key_is_told_when_it_is_opened(options, says):
    with pytest.raises(DeviceError, match=says):
        bhaptics_sdk("arm", CLOCK, **options).open(1.0)


def test_missing_package_says_what_to_install(monkeypatch, port):
    monkeypatch.setitem(sys.modules, "bhaptics_python", None)
    with pytest.raises(DeviceNotFound, match=r"pip install 'visavis\[bhaptics-sdk\]'"):
        link_to(port, sdk_link.PlayerSession()).open(1.0)


def test_the_genuine_package_carries_frames_to_a_players_port(tmp_path):
    try:
        import bhaptics_python  # noqa: F401 - whether it loads here
    except ImportError as cause:
        pytest.skip(f"bhaptics-python does not load here ({cause}): on Linux it needs glibc 2.38")
    pytest.importorskip("websockets", reason="websockets is not installed: pip install websockets")
    pytest.importorskip("cryptography", reason="cryptography is not installed")
    from tests.devices.wire_ends.bhaptics_player import BhapticsPlayer

    (tmp_path / "key.txt").write_text("the-key\n", "utf-8")
    driver = bhaptics_sdk("arm", CLOCK, app_id="the-app", api_key_file=str(tmp_path / "key.txt"))
    with contextlib.ExitStack() as stack:
        player = stack.enter_context(BhapticsPlayer(tmp_path, sdk_link.PLAYER[1]))
        driver.open(5.0)
        driver.start(lambda batch: None)
        driver.set_amplitudes(ON, 10_000)
        end_ns = CLOCK.now_ns() + 5 * NS_PER_S
        while driver.info.model != "TactSleeve" or not any(
            kind == "SdkPlayDotMode" for kind, _ in player.requests
        ):
            assert CLOCK.now_ns() < end_ns, "it did not happen in time"
            driver.keep_alive()
            driver.poll(0.02)
        driver.silence()
        while not numbers_stopped(player):
            assert CLOCK.now_ns() < end_ns, "it did not happen in time"
            driver.poll(0.02)
        driver.close()
    assert driver.state is DeviceState.CLOSED
    assert player.paths[0].startswith("/v3/feedback?workspace_id=the-app&api_key=the-key&version=")
    frames = [json.loads(said) for kind, said in player.requests if kind == "SdkPlayDotMode"]
    assert frames[0]["motorValues"] == [100, 0, 50, 0, 0, 25]
    assert (frames[0]["position"], frames[0]["durationMillis"]) == (1, 100)
    assert str(frames[-1]["requestId"]) in numbers_stopped(player)


def numbers_stopped(player):
    return [said for kind, said in player.requests if kind == "SdkStopByRequestId"]
