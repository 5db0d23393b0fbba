"""Receive a moving body from Xsens MVN's network streamer (UDP 9763, type 02).

Codec: `visavis.devices.drivers.xsens.codec`. The stream goes one way: MVN's time code (ms since its
session began) is `t_device_ns`, and `health` fits it to the host's clock by the lower envelope of
the arrivals. MVN's z-up world becomes ours; its x axis becomes our −z.
"""

from collections.abc import Iterable

from visavis.devices.drivers.streaming.body_device import BodyDevice, BodySample
from visavis.devices.drivers.xsens import codec
from visavis.devices.drivers.xsens.spec import XSENS
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import NS_PER_MS, Clock
from visavis.lab.errors import DeviceTimeout


class XsensMvn(BodyDevice):
    """Follow the `BodyTracker` contract over MVN's stream.

    `character` counts from 0; None takes the only one, and `check` refuses a second.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        rate_hz: float = 240.0,
        character: int | None = None,
        lost_after_s: float = 2.0,
    ) -> None:
        self._given_character = character
        self._character: int | None = character
        self._assembler = codec.Assembler()
        super().__init__(
            role,
            transport,
            clock,
            XSENS,
            segments=codec.SEGMENTS,
            rate_hz=rate_hz,
            lost_after_s=lost_after_s,
        )

    def _connect(self, deadline_ns: int) -> None:
        """Wait for the first readable datagram: MVN streams whether or not we ask."""
        self._character = self._given_character
        others: set[str] = set()
        while (now_ns := self._clock.now_ns()) < deadline_ns:
            left_s = (deadline_ns - now_ns) / 1e9
            for message in self._transport.receive(min(0.05, left_s)):
                datagram = codec.decode_datagram(message.frames[0])
                if isinstance(datagram, codec.Datagram):
                    return
                if datagram is not None:
                    others.add(datagram)
        summary = f"only types {', '.join(sorted(others))}" if others else "nothing"
        raise DeviceTimeout(f"heard {summary} from MVN in time", remedy=XSENS.remedy)

    def _decode(self, message: Message) -> Iterable[BodySample]:
        datagram = codec.decode_datagram(message.frames[0])
        if datagram is None:
            self._malformed += 1
            return ()
        if isinstance(datagram, str):
            return ()
        if self._character is None:
            self._character = datagram.character
        if datagram.character != self._character:
            if self._given_character is None:
                self._refuse_second(datagram.character)
            return ()
        pose = self._assembler.add(datagram)
        if pose is None:
            return ()
        return (
            BodySample(
                pose.sample,
                pose.time_code_ms * NS_PER_MS,
                pose.position_m,
                pose.orientation_wxyz,
                pose.valid,
            ),
        )

    def _refuse_second(self, other: int) -> None:
        fault = self._blocking(
            f"MVN streams characters {self._character} and {other}, and none was chosen",
            "give character in lab_config.yaml, or stream only one",
        )
        self._note("character", fault)
