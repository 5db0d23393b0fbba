"""A voice key and the keys of the participant's window, as one response device.

Both deliver into one stream, in the order of session time. A voice is recognised some tens of
milliseconds after its onset; a key pressed meanwhile is held back for as long, with its own time.
"""

from collections.abc import Callable
from typing import Any

from visavis.devices.byte_links import ByteLink
from visavis.devices.contracts import DeviceState, Fault, Sink
from visavis.devices.drivers.buttons.keyboard import Keyboard
from visavis.devices.drivers.voice.driver import Row, VoiceKey
from visavis.devices.drivers.voice.spec import VoiceAndKeyboardOptions
from visavis.devices.spec import AnySpec
from visavis.lab.clock import Clock
from visavis.lab.schema import SampleBatch


class VoiceAndKeyboard(VoiceKey):
    """Follow the `ResponseInput` contract over a microphone and a window; `hear` takes keys."""

    def __init__(
        self,
        role: str,
        load: Callable[[], Any],
        link: ByteLink,
        clock: Clock,
        *,
        spec: AnySpec,
        options: VoiceAndKeyboardOptions,
        is_simulated: bool = False,
    ) -> None:
        super().__init__(role, load, clock, spec=spec, options=options, is_simulated=is_simulated)
        self._keyboard = Keyboard(role, link, clock, keys=options.keys)
        self._waiting: list[Row] = []
        self.controls = (*self._keyboard.controls, *self.controls)

    def hear(self, key: str, is_down: bool) -> None:
        """Take a press or release from the participant's window, now."""
        self._keyboard.hear(key, is_down)

    def open(self, deadline_s: float) -> None:
        """Open the microphone; the window needs no opening."""
        super().open(deadline_s)
        self._keyboard.open(deadline_s)

    def start(self, sink: Sink) -> None:
        """Begin delivering; what was pressed or said before is ignored."""
        super().start(sink)
        self._waiting.clear()
        self._keyboard.start(self._take_keys)

    def stop(self) -> None:
        """Stop delivering; microphone and window stay open."""
        super().stop()
        self._keyboard.stop()

    def close(self) -> None:
        """Release the microphone; idempotent."""
        super().close()
        self._keyboard.close()

    def check(self) -> tuple[Fault, ...]:
        """Report what is wrong with the microphone, and keys without a name."""
        return (*super().check(), *self._keyboard.check())

    def _take_keys(self, batch: SampleBatch) -> None:
        for t_ns, t_device_ns, row in zip(
            batch.t_host_ns.tolist(), batch.t_device_ns.tolist(), batch.values, strict=True
        ):
            control = self._keyboard.controls[row["control"]]
            self._waiting.append(Row(t_ns, t_device_ns, control, float(row["value_01"])))

    def _final_rows(self, rows: list[Row]) -> list[Row]:
        """Return voices, and the keys before which no voice can begin any more."""
        self._keyboard.poll(0.0)
        until_ns = self._clock.now_ns()
        if self._life.state is DeviceState.STREAMING and self._detector is not None:
            until_ns = self._detector.final_until_ns + self._card_clock.offset_ns()
        self._waiting = sorted([*self._waiting, *rows], key=lambda row: row.t_host_ns)
        count = sum(row.t_host_ns <= until_ns for row in self._waiting)
        final_rows, self._waiting = self._waiting[:count], self._waiting[count:]
        return final_rows
