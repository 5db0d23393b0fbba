"""Button boxes that send one byte a press, as scanners' boxes and boards of a lab's own do."""

from collections.abc import Iterable, Mapping

from visavis.devices.byte_links import ByteLink
from visavis.devices.drivers.buttons.device import ButtonDevice, Press
from visavis.devices.drivers.buttons.spec import BYTES
from visavis.lab.clock import Clock


class ByteButtons(ButtonDevice):
    """Follow the `ResponseInput` contract over bytes that each are a press; no release is told.

    A button is called by its byte's character ("1"), or by `keys` as studies ask for it. Other
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
        self._known = {ord(button): button for button in buttons}
        self._ignored = set(ignored.encode("latin-1")) - set(self._known)
        self._damaged = 0
        super().__init__(role, link, clock, BYTES, buttons=tuple(buttons), keys=keys)

    @property
    def damaged(self) -> int:
        """How many bytes were no button's."""
        return self._damaged

    def _fresh(self) -> None:
        self._damaged = 0

    def _read(self, data: bytes) -> Iterable[Press]:
        for code in data:
            if code in self._known:
                yield Press(self._known[code], 1.0)
            elif code not in self._ignored:
                self._damaged += 1
