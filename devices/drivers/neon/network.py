"""Carry Neon's network messages: HTTP, WebSocket, RTSP and time echo, by the vendor's client.

One thread of this module runs an asyncio loop. Every message gets its host stamp in that thread, as
soon as the loop hands it over.
"""

import asyncio
import json
import logging
import struct
import threading
from collections.abc import Coroutine, Sequence
from concurrent.futures import TimeoutError as NotInTime
from typing import Any

from visavis.devices.arrivals import Arrivals
from visavis.devices.drivers.neon.codec import STAMP
from visavis.devices.libraries import NEON
from visavis.devices.transports import Exchange, Frames, Message, NoTopics
from visavis.lab.clock import NS_PER_MS, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceNotFound, DeviceTimeout

ECHO = struct.Struct("!Q")
ECHO_TIMEOUT_S = 1.0
GOODBYE_S = 0.5
CLOSING_S = 0.02
"""Time for the loop to close sockets after they were given up."""

RECORDING_PATHS = {b"record": "/api/recording:start", b"save": "/api/recording:stop_and_save"}
WIRE_LOGGERS = ("aiortsp", "rtp.session", "rtsp_client", "pupil_labs.realtime_api", "websockets")


class NeonNetwork(NoTopics):
    """Speak to one Companion app at an explicit address; no multicast is needed.

    Requests: (status,) (calibration,) (time,) (record,) (save,). Messages: (gaze, stamp, payload),
    (status, json), and (event, recording) after each event: empty where it reached no recording.
    """

    def __init__(
        self, address: str, port: int, clock: Clock, *, remedy: str = "", is_simulated: bool = False
    ) -> None:
        self.is_simulated = is_simulated
        self._address = address
        self._port = port
        self._clock = clock
        self._remedy = remedy
        self._arrivals = Arrivals()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self._device: Any = None
        self._echo: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None
        self._echo_at: tuple[str, int] = (address, 0)
        self._echo_alone: asyncio.Lock | None = None

    @property
    def kind(self) -> str:
        """Name the address."""
        return f"neon http://{self._address}:{self._port}"

    def open(self, deadline_s: float) -> None:
        """Start the loop, read the status, begin the gaze stream and the status updates."""
        self.close()
        library = NEON.imported("device")
        for name in WIRE_LOGGERS:
            logging.getLogger(name).setLevel(logging.CRITICAL)
        self._arrivals = Arrivals()
        loop = self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=loop.run_forever, name="neon-network", daemon=True)
        self._thread.start()
        try:
            self._run(self._begin(library.device.Device), deadline_s)
        except DeviceError:
            self.close()
            raise

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Ask and wait."""
        sent_ns = self._clock.now_ns()
        if frames[0] == b"time":
            message = self._run(self._exchange_time(), timeout_s)
            return Exchange(message.frames, message.t_sent_ns or sent_ns, message.t_host_ns)
        answer = self._run(self._answer(frames), timeout_s)
        return Exchange(answer, sent_ns, self._clock.now_ns())

    def post(self, frames: Frames) -> None:
        """Ask for the time without waiting; a missing answer is not an error."""
        if frames[0] == b"time" and self._loop is not None:
            asyncio.run_coroutine_threadsafe(self._post_time(), self._loop)

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return what came; raises DeviceDisconnected once the stream has ended."""
        return self._arrivals.take(timeout_s, self._remedy)

    def send(self, port: int, frames: Frames) -> None:
        """Send an event: name and the phone's time in ns."""
        event = self._run(self._device.send_event(frames[1].decode(), int(frames[2])), 2.0)
        recording = (event.recording_id or "").encode()
        self._arrivals.add(Message(self._clock.now_ns(), (b"event", recording)))

    def close(self) -> None:
        """Stop the tasks, the loop and its thread; idempotent."""
        loop, self._loop = self._loop, None
        if loop is None or self._thread is None:
            return
        asyncio.run_coroutine_threadsafe(self._end(), loop).result(timeout=5.0)
        loop.call_soon_threadsafe(loop.stop)
        self._thread.join(5.0)
        loop.close()
        self._thread = None

    # ---- in the loop's thread ---------------------------------------------------------------

    async def _begin(self, device_class: Any) -> None:
        self._device = device_class(self._address, self._port)
        self._echo_alone = asyncio.Lock()
        status = await self._device.get_status()
        self._echo_at = (self._address, int(status.phone.time_echo_port or 0))
        sensor = status.direct_gaze_sensor()
        url = None if sensor is None else sensor.url
        if url is not None:
            self._tasks.append(asyncio.create_task(self._stream(url)))
        self._tasks.append(asyncio.create_task(self._updates()))

    async def _stream(self, url: str) -> None:
        from pupil_labs.realtime_api.streaming import base

        try:
            async with base.RTSPRawStreamer(url) as streamer:
                reader = streamer.reader
                async for packet in reader.iter_packets():
                    now_ns = self._clock.now_ns()
                    try:
                        seconds = reader.absolute_timestamp_from_packet(packet)
                    except base._UnknownClockoffsetError:  # noqa: SLF001 - raised by a public call
                        continue  # before the first sender report no packet has a time
                    stamp = STAMP.pack(round(seconds * 1e9), packet.seq)
                    self._arrivals.add(Message(now_ns, (b"gaze", stamp, bytes(packet.data))))
        except (OSError, ValueError, RuntimeError, KeyError) as problem:
            self._arrivals.end(f"the gaze stream broke: {problem}")
            return
        self._arrivals.end("the gaze stream ended")

    async def _updates(self) -> None:
        async for component in self._device.status_updates():
            part = {"model": type(component).__name__, "data": component._asdict()}
            frame = json.dumps([part], default=str).encode()
            self._arrivals.add(Message(self._clock.now_ns(), (b"status", frame)))

    async def _answer(self, frames: Frames) -> Frames:
        if frames[0] in RECORDING_PATHS:
            return await self._command_recording(frames[0])
        path = {b"status": "/api/status", b"calibration": "/calibration.bin"}[frames[0]]
        session = self._device.active_session
        async with session.get(f"http://{self._address}:{self._port}{path}") as response:
            raw: bytes = await response.read() if response.status == 200 else b""
        if frames[0] == b"status" and raw:
            raw = json.dumps(json.loads(raw)["result"]).encode()
        return frames[0], raw

    async def _command_recording(self, command: bytes) -> Frames:
        """Begin or save a recording; the app's reason comes back where it refuses."""
        url = f"http://{self._address}:{self._port}{RECORDING_PATHS[command]}"
        async with self._device.active_session.post(url) as response:
            answer = await response.json()
            reason = "" if response.status == 200 else str(answer.get("message") or response.status)
        return command, reason.encode()

    async def _exchange_time(self) -> Message:
        assert self._echo_alone is not None  # noqa: S101 - made with the loop
        async with self._echo_alone:
            try:
                if self._echo is None:
                    self._echo = await asyncio.open_connection(*self._echo_at)
                reader, writer = self._echo
                sent_ns = self._clock.now_ns()
                token = ECHO.pack(sent_ns // NS_PER_MS)
                writer.write(token)
                answer = await asyncio.wait_for(reader.readexactly(16), ECHO_TIMEOUT_S)
            except BaseException:
                self._drop_echo()
                raise
            now_ns = self._clock.now_ns()
        if answer[:8] != token:
            self._drop_echo()
            raise ConnectionError("the time echo answered another question")
        return Message(now_ns, (b"time", answer[8:]), sent_ns)

    async def _post_time(self) -> None:
        try:
            self._arrivals.add(await self._exchange_time())
        except (OSError, EOFError, TimeoutError):
            return  # the driver counts unanswered requests

    async def _end(self) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._tasks = []
        if self._device is not None:
            await self._device.close()
        others = [t for t in asyncio.all_tasks() if t is not asyncio.current_task()]
        if others:  # sessions say goodbye when their stream is cancelled
            await asyncio.wait(others, timeout=GOODBYE_S)
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
        self._drop_echo()  # last: an exchange under way may have opened it again
        await asyncio.sleep(CLOSING_S)

    def _drop_echo(self) -> None:
        if self._echo is not None:
            self._echo[1].close()
            self._echo = None

    # ---- across threads ---------------------------------------------------------------------

    def _run(self, work: Coroutine[Any, Any, Any], timeout_s: float) -> Any:
        if self._loop is None:
            work.close()
            raise DeviceDisconnected(f"{self.kind} is not open", remedy=self._remedy)
        waiting = asyncio.run_coroutine_threadsafe(work, self._loop)
        try:
            return waiting.result(timeout_s)
        except (NotInTime, TimeoutError) as cause:
            waiting.cancel()
            raise DeviceTimeout(
                f"{self.kind} did not answer within {timeout_s:g} s", remedy=self._remedy
            ) from cause
        except Exception as cause:  # the vendor's client raises errors of many libraries
            raise DeviceNotFound(
                f"{self.kind}: {type(cause).__name__}: {cause}", remedy=self._remedy
            ) from cause
