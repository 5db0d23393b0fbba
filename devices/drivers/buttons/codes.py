"""Button boxes that send one byte per press: boxes at scanners, boards made in the lab."""

from collections.abc import Iterable, Mapping

from visavis.devices.byte_links import ByteLink
from visavis.devices.drivers.buttons.device import ButtonDevice, Press
from visavis.devices.drivers.buttons.spec import BYTES
from visavis.lab.clock import Clock


class ByteButtons(ButtonDevice):
    """Follow the `ResponseInput` contract over bytes of one press each; releases are not reported.

    The name of a button is its byte's character ("1"), or the name that `keys` gives it. Other
    bytes are counted.
    """

    def __init__(
        self,
        role: str,
        link: ByteLink,
        clock: Clock,
        *,
        buttons: str,
        ignored: str,
        keys: Mapping[str, str],
    ) -> None:
        self._button_of = {ord(button): button for button in buttons}
        self._ignored_codes = set(ignored.encode("latin-1")) - set(self._button_of)
        self._unreadable_count = 0
        super().__init__(role, link, clock, BYTES, buttons=tuple(buttons), keys=keys)

    @property
    def unreadable_count(self) -> int:
        """How many bytes belonged to no button."""
        return self._unreadable_count

    def _fresh(self) -> None:
        self._unreadable_count = 0

    def _read(self, data: bytes) -> Iterable[Press]:
        for code in data:
            if code in self._button_of:
                yield Press(self._button_of[code], 1.0)
            elif code not in self._ignored_codes:
                self._unreadable_count += 1
