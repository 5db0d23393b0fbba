"""A band on a virtual Bluetooth radio (bumble), bridged to a pseudo-terminal for pyserial.

Both sides are whole host stacks over virtual controllers: classic with SDP (serial port, 0x1101)
and RFCOMM, or low energy with a GATT Nordic UART service. The pseudo-terminal stands for the
serial port that an operating system makes of a paired band. Not modelled: radio and its loss,
pairing and encryption, connection intervals (packets cross at once), other devices.
"""

import asyncio
import contextlib
import os
from typing import Any, Literal

from tests.devices.wire_ends.armband_pty import open_terminal
from tests.devices.wire_ends.loop_thread import LoopThread
from visavis.devices.byte_links import BytePeer
from visavis.lab.clock import Clock
from visavis.lab.errors import DeviceError

UART = "6E40000{}-B5A3-F393-E0A9-E50E24DCCA9E"
PUMP_S = 0.001
START_S = 10.0
CHANNEL = 4
LE_PACKET_BYTES = 20
RECORD = 0x00010001


class VirtualBluetooth(LoopThread):
    """Serve until closed; a context manager. `port` is what pyserial opens.

    `found_channel` is the RFCOMM channel that SDP told (classic). `drop` ends the connection from
    the band's side; the terminal hangs up then, as a serial port of a lost band does.
    """

    def __init__(self, peer: BytePeer, clock: Clock, kind: Literal["classic", "le"]) -> None:
        super().__init__()
        self.found_channel: int | None = None
        self._peer, self._clock, self._kind = peer, clock, kind
        self._own, self._other, self.port = open_terminal(blocking=False)
        self._to_host: Any = None
        self._to_band: Any = None
        self._connection: Any = None
        self._is_up = False
        self._writing = asyncio.Lock()
        self._outbox: set[asyncio.Future[None]] = set()
        self._begin("virtual Bluetooth", START_S)

    def close(self) -> None:
        """End both sides and the terminal; re-raises what stopped the thread."""
        try:
            super().close()
        finally:
            self._hang_up()

    def drop(self) -> None:
        """End the connection and wait until the terminal has hung up."""
        asyncio.run_coroutine_threadsafe(self._drop(), self._loop).result(START_S)

    async def _serve(self) -> None:
        from bumble.controller import Controller
        from bumble.device import Device
        from bumble.hci import Address
        from bumble.host import Host
        from bumble.link import LocalLink
        from bumble.transport.common import AsyncPipeSink

        link: Any = LocalLink()  # type: ignore[no-untyped-call]  # bumble leaves it so
        devices = []
        for name, address in (("computer", "F0:F1:F2:F3:F4:F5"), ("band", "F5:F4:F3:F2:F1:F0")):
            controller = Controller(name, link=link, public_address=address)
            host = Host(controller, AsyncPipeSink(controller))
            devices.append(Device(name=name, address=Address(address), host=host))
        computer, band = devices
        self._peer.connect(self._clock.now_ns())
        if self._kind == "classic":
            await self._join_classic(computer, band)
        else:
            await self._join_le(computer, band)
        self._is_up = True
        self._loop.add_reader(self._own, self._from_terminal)
        self._ready.set()
        while not self._stop.is_set():
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stop.wait(), PUMP_S)
            await self._pump()
        if self._is_up:
            self._loop.remove_reader(self._own)
        here = asyncio.current_task()
        left = [task for task in asyncio.all_tasks() if task is not here]
        for task in left:
            task.cancel()
        await asyncio.gather(*left, return_exceptions=True)

    async def _join_classic(self, computer: Any, band: Any) -> None:
        from bumble import rfcomm
        from bumble.core import BT_SERIAL_PORT_SERVICE, PhysicalTransport

        for device in (computer, band):
            device.classic_enabled = True
            device.le_enabled = False
        accepted = asyncio.get_running_loop().create_future()
        server = rfcomm.Server(band)
        channel = server.listen(accepted.set_result, CHANNEL)
        band.sdp_service_records = {
            RECORD: rfcomm.make_service_sdp_records(RECORD, channel, BT_SERIAL_PORT_SERVICE)
        }
        await computer.power_on()
        await band.power_on()
        connection = self._connection = await computer.connect(
            band.public_address, PhysicalTransport.BR_EDR
        )
        self.found_channel = await rfcomm.find_rfcomm_channel_with_uuid(
            connection, BT_SERIAL_PORT_SERVICE
        )
        if self.found_channel is None:
            raise RuntimeError("SDP told no channel of the serial port")
        client = rfcomm.Client(connection)
        near = await (await client.start()).open_dlc(self.found_channel)
        far = await accepted
        near.sink = self._to_terminal
        far.sink = self._from_radio
        self._to_band, self._to_host = near.write, far.write

    async def _join_le(self, computer: Any, band: Any) -> None:
        from bumble.core import UUID
        from bumble.device import Peer
        from bumble.gatt import Characteristic, CharacteristicValue, Service

        properties = Characteristic.Properties
        received = CharacteristicValue(write=lambda _, data: self._from_radio(bytes(data)))
        write = Characteristic(
            UART.format(2),
            properties.WRITE | properties.WRITE_WITHOUT_RESPONSE,
            Characteristic.WRITEABLE,
            received,
        )
        notify = Characteristic(UART.format(3), properties.NOTIFY, Characteristic.READABLE, b"")
        band.add_service(Service(UART.format(1), [write, notify]))
        await computer.power_on()
        await band.power_on()
        await band.start_advertising(auto_restart=False)
        connection = self._connection = await computer.connect(band.random_address)
        peer = Peer(connection)
        await peer.discover_services()
        await peer.discover_characteristics()
        (into,) = peer.get_characteristics_by_uuid(UUID(UART.format(2)))
        (out,) = peer.get_characteristics_by_uuid(UUID(UART.format(3)))
        await out.subscribe(lambda data: self._to_terminal(bytes(data)))
        self._to_band = into.write_value
        self._to_host = lambda data: band.notify_subscribers(notify, data)

    async def _pump(self) -> None:
        if not self._is_up:
            return
        try:
            chunks = self._peer.outgoing(self._clock.now_ns())
        except DeviceError:
            await self._drop()
            return
        for chunk in chunks:
            if self._kind == "classic":
                self._to_host(chunk.data)
                continue
            for i in range(0, len(chunk.data), LE_PACKET_BYTES):
                await self._to_host(chunk.data[i : i + LE_PACKET_BYTES])

    async def _drop(self) -> None:
        if self._is_up:
            self._is_up = False
            self._loop.remove_reader(self._own)
            await self._connection.disconnect()
            self._hang_up()

    def _hang_up(self) -> None:
        for descriptor in (self._own, self._other):
            if descriptor >= 0:
                os.close(descriptor)
        self._own = self._other = -1

    def _from_terminal(self) -> None:
        with contextlib.suppress(BlockingIOError):
            data = os.read(self._own, 4096)
            if self._kind == "classic":
                self._to_band(data)
                return
            task = asyncio.ensure_future(self._write_le(data))
            self._outbox.add(task)
            task.add_done_callback(self._outbox.discard)

    async def _write_le(self, data: bytes) -> None:
        async with self._writing:
            for i in range(0, len(data), LE_PACKET_BYTES):
                await self._to_band(data[i : i + LE_PACKET_BYTES])

    def _to_terminal(self, data: bytes) -> None:
        if self._is_up:
            os.write(self._own, data)

    def _from_radio(self, data: bytes) -> None:
        with contextlib.suppress(DeviceError):
            self._peer.accept(data, self._clock.now_ns())
