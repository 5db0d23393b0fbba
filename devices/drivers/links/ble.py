"""Reach a band over a serial service of Bluetooth LE, through bleak.

LE has no serial port of its own; makers of modules have each their service. Those of `SERVICES` are
found by themselves, any other is given by the UUIDs of its characteristics.

One thread with one asyncio loop serves every link. An attempt to connect continues after `open` ran
out of time, and the next `open` takes it over, because finding and connecting takes longer than one
poll.
"""

import asyncio
import contextlib
import threading
from collections import deque
from collections.abc import Coroutine, Sequence
from concurrent.futures import Future
from concurrent.futures import TimeoutError as TooLate
from typing import Any, TypeVar

from visavis.devices.byte_links import Chunk
from visavis.devices.drivers.links.options import BleBandOptions
from visavis.devices.libraries import BLE
from visavis.devices.one_of_a_kind import the_only
from visavis.devices.wiring import Site
from visavis.lab.clock import Clock
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceNotFound, DeviceTimeout

T = TypeVar("T")

SERVICES = {
    "Nordic UART": (
        "6e400002-b5a3-f393-e0a9-e50e24dcca9e",
        "6e400003-b5a3-f393-e0a9-e50e24dcca9e",
    ),
    "HM-10 (FFE1)": (
        "0000ffe1-0000-1000-8000-00805f9b34fb",
        "0000ffe1-0000-1000-8000-00805f9b34fb",
    ),
    "Microchip transparent UART": (
        "49535343-8841-43f4-a8d4-ecbe34729bb3",
        "49535343-1e4d-4bd9-ba61-23c647249616",
    ),
}
"""Serial services: characteristics to write to and to be notified by. Sources: Nordic's and
Microchip's documents of their services, the data sheet of Jinan Huamao's HM-10."""

ATTEMPT_S = 10.0
OTHERS_S = 1.5
"""How long a second band that fits is looked for: the slowest common interval of advertising."""
ORPHAN_S = 10.0
WRITE_S = 0.5
CLOSE_S = 2.0
LINGER_S = 0.1
"""Longer than two of the slowest connection intervals."""


class BleThread:
    """A thread with an event loop; links share `SHARED_THREAD` unless given one of their own."""

    def __init__(self) -> None:
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()

    def loop(self) -> asyncio.AbstractEventLoop:
        """Return the loop, started when first asked for."""
        with self._lock:
            if self._loop is None:
                loop = self._loop = asyncio.new_event_loop()
                self._thread = threading.Thread(target=loop.run_forever, name="ble", daemon=True)
                self._thread.start()
            return self._loop

    def begin(self, work: Coroutine[Any, Any, T]) -> "Future[T]":
        """Run a coroutine there."""
        return asyncio.run_coroutine_threadsafe(work, self.loop())

    def close(self) -> None:
        """End the thread; what still runs is cancelled."""
        with self._lock:
            loop, thread = self._loop, self._thread
            self._loop = self._thread = None
        if loop is None or thread is None:
            return
        asyncio.run_coroutine_threadsafe(_cancel_all(), loop).result(CLOSE_S)
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


SHARED_THREAD = BleThread()


class BleLink:
    """A `ByteLink` over notifications and writes without response.

    `address` or the advertised `name` (its beginning is enough) finds the band; two that fit the
    name are refused. Characteristics that are not given are those of the first of `SERVICES` that
    it has; with `notify_uuid` alone it is only listened to. Bytes go without response where the
    characteristic takes them so. With `splits`, a message longer than a packet goes in several;
    otherwise it is refused, because the device takes one message per packet.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        address: str = "",
        name: str = "",
        splits: bool = True,
        write_uuid: str = "",
        notify_uuid: str = "",
        device: str = "device",
        is_simulated: bool = False,
        thread: BleThread | None = None,
    ) -> None:
        if not address and not name:
            raise DeviceNotFound(
                "no Bluetooth device is named", remedy="give address or name in lab_config.yaml"
            )
        self.is_simulated = is_simulated
        self._clock = clock
        self._address = address
        self._name = name
        self._remedy = (
            f"switch the {device} on and bring it near; disconnect it from phones; "
            "switch Bluetooth on"
        )
        self._splits = splits
        self._uuids = (write_uuid, notify_uuid)
        self._found_address = ""
        self._thread = thread if thread is not None else SHARED_THREAD
        self._bleak: Any = None
        self._client: Any = None
        self._characteristic: Any = None
        self._attempt: Future[Any] | None = None
        self._is_open = False
        self._chunks: deque[Chunk] = deque()
        self._something = threading.Condition()
        self._is_gone = True

    @property
    def kind(self) -> str:
        """Name the address or the name that is searched for."""
        return f"ble {self._address or self._name}"

    def open(self, deadline_s: float) -> None:
        """Find the band, connect and listen; see the module about deadlines."""
        self._bleak = BLE.imported("exc")
        self._is_open = False
        if self._attempt is None:
            self._release()
            self._attempt = self._thread.begin(self._connect())
        attempt = self._attempt
        try:
            attempt.result(max(0.0, deadline_s))
        except TooLate as cause:
            if not attempt.done():
                text = f"{self.kind}: not connected within {deadline_s:g} s"
                raise DeviceTimeout(text, remedy=self._remedy) from cause
            self._attempt = None
            raise self._not_found(cause) from cause
        except DeviceError:
            self._attempt = None
            raise
        except (self._bleak.exc.BleakError, OSError, EOFError) as cause:
            self._attempt = None
            raise self._not_found(cause) from cause
        self._attempt = None
        with self._something:
            self._chunks.clear()
            if self._is_gone:
                raise self._not_found(ConnectionError("lost at once"))
            self._is_open = True

    def write(self, data: bytes) -> int:
        """Hand over the bytes in one packet or, where allowed, several; see `ByteLink`."""
        client = self._client
        if not self._is_open or self._is_gone or client is None:
            raise DeviceDisconnected(f"{self.kind} is not connected", remedy=self._remedy)
        if self._characteristic is None:
            raise DeviceError(f"{self.kind} only notifies", remedy="give its write_uuid")
        longest = self._characteristic.max_write_without_response_size
        if len(data) > longest and not self._splits:
            raise DeviceError(
                f"a message of {len(data)} bytes does not fit a packet of {longest}",
                remedy="use a shorter time to live, or a Bluetooth adapter with longer packets",
            )
        pieces = [data[i : i + longest] for i in range(0, len(data), longest)]
        work = self._thread.begin(self._write(client, pieces))
        try:
            work.result(WRITE_S)
        except TooLate as cause:
            work.cancel()
            raise DeviceTimeout(f"{self.kind} takes no bytes", remedy=self._remedy) from cause
        except (self._bleak.exc.BleakError, OSError, EOFError) as cause:
            raise DeviceDisconnected(
                f"{self.kind} is gone: {cause}", remedy=self._remedy
            ) from cause
        return self._clock.now_ns()

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Return the notifications that came; see `ByteLink`."""
        with self._something:
            if not self._chunks and not self._is_gone and timeout_s > 0:
                self._something.wait(timeout_s)
            chunks = tuple(self._chunks)
            self._chunks.clear()
            if not chunks and (self._is_gone or not self._is_open):
                raise DeviceDisconnected(f"{self.kind} is gone", remedy=self._remedy)
        return chunks

    def close(self) -> None:
        """Disconnect; an attempt under way continues for the next `open`. Idempotent."""
        self._is_open = False
        if self._attempt is None:
            self._release()

    def _release(self) -> None:
        client, self._client = self._client, None
        self._is_gone = True
        if client is not None:
            with contextlib.suppress(TooLate, OSError, EOFError, self._bleak.exc.BleakError):
                self._thread.begin(_say_goodbye(client)).result(CLOSE_S)

    # ---- in the thread of the loop ------------------------------------------------------------

    async def _connect(self) -> None:
        bleak = self._bleak
        address = self._address or self._found_address
        if address:
            device = await bleak.BleakScanner.find_device_by_address(address, timeout=ATTEMPT_S)
        else:
            device = await self._by_name()
        if device is None:
            self._found_address = ""  # some change their address: look for the name next time
            raise bleak.exc.BleakError(f"{self.kind} does not advertise")
        client = bleak.BleakClient(device, self._on_gone, timeout=ATTEMPT_S)
        await client.connect()
        uuids = self._uuids if self._uuids[1] else _serial_service(client.services)
        if uuids is None or not all(
            client.services.get_characteristic(uuid) is not None for uuid in uuids if uuid
        ):
            offers = ", ".join(sorted(service.uuid for service in client.services)) or "none"
            await client.disconnect()
            raise DeviceNotFound(
                f"{self.kind} has no service that is known here; its services: {offers}",
                remedy="give write_uuid and notify_uuid of its characteristics in lab_config.yaml",
            )
        self._found_address = device.address
        write_uuid, notify_uuid = uuids
        characteristic = client.services.get_characteristic(write_uuid) if write_uuid else None
        self._client, self._characteristic = client, characteristic
        self._is_gone = False
        if characteristic is not None and "indicate" in characteristic.properties:
            await client.start_notify(write_uuid, self._on_data)  # it answers what is written
        await client.start_notify(notify_uuid, self._on_data)
        asyncio.get_running_loop().call_later(ORPHAN_S, self._drop_orphan, client)

    async def _write(self, client: Any, pieces: Sequence[bytes]) -> None:
        needs_answer = "write-without-response" not in self._characteristic.properties
        for piece in pieces:
            await client.write_gatt_char(self._characteristic, piece, response=needs_answer)

    async def _by_name(self) -> Any:
        """Return the only device whose name begins so, or None if there is none in time."""
        fitting: dict[str, tuple[str, Any]] = {}
        first = asyncio.Event()

        def see(device: Any, advertisement: Any) -> None:
            name = advertisement.local_name or device.name or ""
            if name.startswith(self._name):
                fitting[device.address] = (name, device)
                first.set()

        async with self._bleak.BleakScanner(see):
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(first.wait(), ATTEMPT_S)
                await asyncio.wait_for(asyncio.Event().wait(), OTHERS_S)
        if not fitting:
            return None
        chosen = the_only(
            list(fitting.values()),
            lambda found: f"{found[0]} ({found[1].address})",
            f"Bluetooth devices that begin with {self._name!r}",
            "give address in lab_config.yaml, or switch the others off",
        )
        return chosen[1]

    def _on_data(self, _: Any, data: bytearray) -> None:
        with self._something:
            self._chunks.append(Chunk(self._clock.now_ns(), bytes(data)))
            self._something.notify_all()

    def _on_gone(self, client: Any) -> None:
        with self._something:
            if client is self._client or self._client is None:
                self._is_gone = True
                self._something.notify_all()

    def _drop_orphan(self, client: Any) -> None:
        if client is self._client and not self._is_open:
            self._orphan = asyncio.ensure_future(client.disconnect())

    def _not_found(self, cause: BaseException) -> DeviceNotFound:
        reason = str(cause) or type(cause).__name__
        if isinstance(cause, FileNotFoundError):
            reason = "this computer runs no Bluetooth service"
        return DeviceNotFound(f"cannot reach {self.kind}: {reason}", remedy=self._remedy)


def _serial_service(services: Any) -> tuple[str, str] | None:
    """Return the characteristics of the first serial service that a device offers."""
    for uuids in SERVICES.values():
        if all(services.get_characteristic(uuid) is not None for uuid in uuids):
            return uuids
    return None


async def _say_goodbye(client: Any) -> None:
    """Let packets without receipt, such as a silence, leave before the link is closed."""
    with contextlib.suppress(TimeoutError):
        await asyncio.wait_for(asyncio.Event().wait(), LINGER_S)
    await client.disconnect()


async def _cancel_all() -> None:
    here = asyncio.current_task()
    tasks = [task for task in asyncio.all_tasks() if task is not here]
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


def ble_band(site: Site[BleBandOptions]) -> BleLink:
    """Return a band's `real`: the link to the only band that fits its options."""
    options = site.options
    return BleLink(
        site.clock,
        address=options.address,
        name=options.name,
        splits=options.splits,
        write_uuid=options.write_uuid,
        notify_uuid=options.notify_uuid,
        device=site.spec.product.model,
    )
