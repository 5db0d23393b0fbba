"""A small `org.bluez` on a private D-Bus, so that the real bleak runs without Bluetooth.

Written against BlueZ's D-Bus documentation (org.bluez.Adapter, Device, GattService,
GattCharacteristic): one adapter, one band with the Nordic UART service. What is written to it
goes to a `BytePeer`, what the peer says comes as notifications. Not modelled: radio, pairing,
other devices, descriptors, reads, write with response, AcquireWrite and AcquireNotify.
"""

import asyncio
import contextlib
import os
import shutil
import subprocess
from collections.abc import Sequence
from typing import Any

from tests.devices.wire_ends.loop_thread import LoopThread
from visavis.devices.byte_links import BytePeer
from visavis.lab.clock import Clock
from visavis.lab.closing import Closing
from visavis.lab.errors import DeviceError

ADAPTER = "/org/bluez/hci0"
UART = "6e40000{}-b5a3-f393-e0a9-e50e24dcca9e"
PUMP_S = 0.002
START_S = 5.0
ADVERTISE_S = 0.05
RESOLVE_S = 0.01


class PrivateBus(Closing):
    """A dbus-daemon of our own; a context manager. `address` is where it listens."""

    def __init__(self) -> None:
        program = shutil.which("dbus-daemon")
        if program is None:
            raise FileNotFoundError("dbus-daemon is not installed")
        self._process = subprocess.Popen(
            [program, "--session", "--nofork", "--nopidfile", "--print-address=1"],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "DBUS_VERBOSE": "0"},
        )
        assert self._process.stdout is not None
        self.address = self._process.stdout.readline().decode().strip()

    def close(self) -> None:
        """End the daemon."""
        self._process.terminate()
        self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()


class FakeBluez(LoopThread):
    """Serve one adapter with one band until closed; a context manager.

    `uuids` are of its service, of what is written to and of what notifies (one characteristic if
    they are the same). `others` are names and addresses of more bands that only advertise.
    `is_near` false stops advertising and refuses connections; `drop` ends a connection as the
    radio would.
    """

    def __init__(
        self,
        bus_address: str,
        peer: BytePeer,
        clock: Clock,
        *,
        name: str = "Buzz 1234",
        address: str = "AA:BB:CC:DD:EE:01",
        mtu: int = 23,
        others: Sequence[tuple[str, str]] = (),
        uuids: tuple[str, str, str] = (UART.format(1), UART.format(2), UART.format(3)),
    ) -> None:
        import dbus_fast
        import dbus_fast.aio

        super().__init__()
        self.is_near = True
        self.packets: list[bytes] = []
        self._dbus: Any = dbus_fast
        self._bus_address = bus_address
        self._peer = peer
        self._clock = clock
        self._name, self._address, self._mtu = name, address, mtu
        self._device = f"{ADAPTER}/dev_{address.replace(':', '_')}"
        self._service = f"{self._device}/service000a"
        self._write = f"{self._service}/char000b"
        self._uuids = uuids
        self._others = dict(others)
        self._notify = self._write if uuids[1] == uuids[2] else f"{self._service}/char000d"
        self._is_known = self._is_connected = self._is_notifying = self._is_discovering = False
        self._bus: Any = None
        self._begin("fake BlueZ", START_S)

    def drop(self) -> None:
        """End the connection from the band's side."""
        self._loop.call_soon_threadsafe(self._disconnected)

    async def _serve(self) -> None:
        self._bus = await self._dbus.aio.MessageBus(bus_address=self._bus_address).connect()
        try:
            self._bus.add_message_handler(self._handle)
            await self._bus.request_name("org.bluez")
            self._ready.set()
            advertised_s = 0.0
            while not self._stop.is_set():
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._stop.wait(), PUMP_S)
                self._pump()
                advertised_s += PUMP_S
                if self._is_discovering and advertised_s >= ADVERTISE_S:
                    advertised_s = 0.0
                    self._advertise()
        finally:
            self._bus.disconnect()

    def _pump(self) -> None:
        if not self._is_connected:
            return
        try:
            chunks = self._peer.outgoing(self._clock.now_ns())
        except DeviceError:
            self._disconnected()
            return
        for chunk in chunks:
            if self._is_notifying:
                longest = self._mtu - 3
                for i in range(0, len(chunk.data), longest):
                    self._changed(
                        self._notify,
                        "org.bluez.GattCharacteristic1",
                        {"Value": self._variant("ay", chunk.data[i : i + longest])},
                    )

    # ---- objects ------------------------------------------------------------------------------

    def _variant(self, signature: str, value: object) -> Any:
        return self._dbus.Variant(signature, value)

    def _adapter_objects(self) -> dict[str, Any]:
        v = self._variant
        return {
            ADAPTER: {
                "org.bluez.Adapter1": {
                    "Address": v("s", "00:00:00:00:00:01"),
                    "Name": v("s", "fake"),
                    "Alias": v("s", "fake"),
                    "Powered": v("b", True),
                    "Discovering": v("b", self._is_discovering),
                    "Roles": v("as", ["central"]),
                }
            }
        }

    def _device_objects(self) -> dict[str, Any]:
        objects = self._device_object(self._name, self._address, is_connected=self._is_connected)
        for name, address in self._others.items():
            objects |= self._device_object(name, address, is_connected=False)
        return objects

    def _device_object(self, name: str, address: str, *, is_connected: bool) -> dict[str, Any]:
        v = self._variant
        return {
            f"{ADAPTER}/dev_{address.replace(':', '_')}": {
                "org.bluez.Device1": {
                    "Address": v("s", address),
                    "AddressType": v("s", "random"),
                    "Name": v("s", name),
                    "Alias": v("s", name),
                    "Adapter": v("o", ADAPTER),
                    "Paired": v("b", False),
                    "Trusted": v("b", False),
                    "Blocked": v("b", False),
                    "LegacyPairing": v("b", False),
                    "Connected": v("b", is_connected),
                    "ServicesResolved": v("b", is_connected),
                    "UUIDs": v("as", [self._uuids[0]]),
                    "RSSI": v("n", -50),
                }
            }
        }

    def _service_objects(self) -> dict[str, Any]:
        v = self._variant
        return {
            self._service: {
                "org.bluez.GattService1": {
                    "UUID": v("s", self._uuids[0]),
                    "Primary": v("b", True),
                    "Device": v("o", self._device),
                    "Includes": v("ao", []),
                }
            },
            **self._characteristics(),
        }

    def _characteristics(self) -> dict[str, Any]:
        writes, notifies = ["write", "write-without-response"], ["notify"]
        if self._write == self._notify:
            return {self._write: self._characteristic(self._uuids[1], [*writes, *notifies])}
        return {
            self._write: self._characteristic(self._uuids[1], writes),
            self._notify: self._characteristic(self._uuids[2], notifies),
        }

    def _characteristic(self, uuid: str, flags: list[str]) -> dict[str, Any]:
        v = self._variant
        return {
            "org.bluez.GattCharacteristic1": {
                "UUID": v("s", uuid),
                "Service": v("o", self._service),
                "Flags": v("as", flags),
                "Notifying": v("b", False),
                "Value": v("ay", b""),
                "MTU": v("q", self._mtu),
            }
        }

    # ---- messages -----------------------------------------------------------------------------

    def _handle(self, message: Any) -> Any:
        if message.message_type is not self._dbus.MessageType.METHOD_CALL:
            return None
        if message.destination != "org.bluez" and not message.path.startswith("/org/bluez"):
            if message.member != "GetManagedObjects":
                return None
        method = getattr(self, f"_on_{message.member}", None)
        if method is None:
            return self._dbus.Message.new_error(
                message, "org.freedesktop.DBus.Error.UnknownMethod", f"no {message.member}"
            )
        return method(message)

    def _done(self, message: Any, signature: str = "", *body: object) -> Any:
        return self._dbus.Message.new_method_return(message, signature, list(body))

    def _failed(self, message: Any, why: str) -> Any:
        return self._dbus.Message.new_error(message, "org.bluez.Error.Failed", why)

    def _on_GetManagedObjects(self, message: Any) -> Any:  # noqa: N802 - D-Bus names
        objects = self._adapter_objects()
        if self._is_known:
            objects |= self._device_objects()
            if self._is_connected:
                objects |= self._service_objects()
        return self._done(message, "a{oa{sa{sv}}}", objects)

    def _on_SetDiscoveryFilter(self, message: Any) -> Any:  # noqa: N802 - D-Bus names
        return self._done(message)

    def _on_StartDiscovery(self, message: Any) -> Any:  # noqa: N802 - D-Bus names
        self._is_discovering = True
        return self._done(message)

    def _on_StopDiscovery(self, message: Any) -> Any:  # noqa: N802 - D-Bus names
        self._is_discovering = False
        return self._done(message)

    def _on_Connect(self, message: Any) -> Any:  # noqa: N802 - D-Bus names
        if not self.is_near:
            return self._failed(message, "le-connection-abort-by-timeout")
        try:
            self._peer.connect(self._clock.now_ns())
        except DeviceError:
            return self._failed(message, "le-connection-abort-by-timeout")
        self._is_connected, self._is_notifying = True, False
        connected = {"Connected": self._variant("b", True)}
        self._changed(self._device, "org.bluez.Device1", connected)
        self._loop.call_later(RESOLVE_S, self._resolve, message)
        return True

    def _resolve(self, message: Any) -> None:
        self._bus.send(self._done(message))
        for path, interfaces in self._service_objects().items():
            self._signal("InterfacesAdded", "oa{sa{sv}}", path, interfaces)
        resolved = {"ServicesResolved": self._variant("b", self._is_connected)}
        self._changed(self._device, "org.bluez.Device1", resolved)

    def _on_Disconnect(self, message: Any) -> Any:  # noqa: N802 - D-Bus names
        self._bus.send(self._done(message))
        self._disconnected()
        return True

    def _on_StartNotify(self, message: Any) -> Any:  # noqa: N802 - D-Bus names
        self._is_notifying = True
        return self._done(message)

    def _on_StopNotify(self, message: Any) -> Any:  # noqa: N802 - D-Bus names
        self._is_notifying = False
        return self._done(message)

    def _on_WriteValue(self, message: Any) -> Any:  # noqa: N802 - D-Bus names
        data = bytes(message.body[0])
        if not self._is_connected or message.path != self._write:
            return self._failed(message, "Not connected")
        if len(data) > self._mtu - 3:
            return self._failed(message, "longer than the packet")
        self.packets.append(data)
        try:
            self._peer.accept(data, self._clock.now_ns())
        except DeviceError:
            self._disconnected()
            return self._failed(message, "Not connected")
        return self._done(message)

    # ---- signals ------------------------------------------------------------------------------

    def _advertise(self) -> None:
        if not self.is_near or self._is_connected:
            return
        if not self._is_known:
            self._is_known = True
            for path, interfaces in self._device_objects().items():
                self._signal("InterfacesAdded", "oa{sa{sv}}", path, interfaces)
        else:
            self._changed(self._device, "org.bluez.Device1", {"RSSI": self._variant("n", -51)})

    def _disconnected(self) -> None:
        if not self._is_connected:
            return
        self._is_connected = self._is_notifying = False
        gone = {
            "Connected": self._variant("b", False),
            "ServicesResolved": self._variant("b", False),
        }
        self._changed(self._device, "org.bluez.Device1", gone)
        for path in dict.fromkeys((self._notify, self._write, self._service)):
            interface = "GattService1" if path == self._service else "GattCharacteristic1"
            self._signal("InterfacesRemoved", "oas", path, [f"org.bluez.{interface}"])

    def _signal(self, member: str, signature: str, *body: object) -> None:
        self._bus.send(
            self._dbus.Message.new_signal(
                "/", "org.freedesktop.DBus.ObjectManager", member, signature, list(body)
            )
        )

    def _changed(self, path: str, interface: str, values: dict[str, Any]) -> None:
        self._bus.send(
            self._dbus.Message.new_signal(
                path,
                "org.freedesktop.DBus.Properties",
                "PropertiesChanged",
                "sa{sv}as",
                [interface, values, []],
            )
        )
