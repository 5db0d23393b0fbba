"""Serve a Neon simulator on this computer: HTTP with WebSocket, RTSP with RTP, time echo.

A thread runs one asyncio loop with three TCP servers; gaze goes out as RTP over UDP after an RTCP
sender report. A "disconnect" closes every connection and refuses new ones while it lasts.
"""

import asyncio
import contextlib
import json
import re
import struct
import threading
from typing import Any

from visavis.devices.sim.neon import EPOCH_NS, NeonSimulator
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock

RTP_HZ = 90_000
NTP_AHEAD_S = 2_208_988_800
SSRC = 0x4E656F6E
REPORT_EVERY_NS = NS_PER_S
TICK_S = 0.001
_ENDS = contextlib.suppress(asyncio.IncompleteReadError, OSError)
SDP = (
    "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=gaze\r\nt=0 0\r\nm=video 0 RTP/AVP 96\r\n"
    "c=IN IP4 0.0.0.0\r\na=rtpmap:96 com.pupillabs.gaze1/90000\r\na=control:trackID=0\r\n"
)


class NeonHost:
    """Serve until the context ends; `port` is the HTTP port."""

    def __init__(self, simulator: NeonSimulator, clock: Clock) -> None:
        self._simulator = simulator
        self._clock = clock
        self.port = self._rtsp_port = self._echo_port = 0
        self._gone = False
        self._targets: dict[Any, tuple[str, int]] = {}
        self._reported_ns: dict[Any, int] = {}
        self._writers: set[asyncio.StreamWriter] = set()
        self._sockets: set[Any] = set()
        self._sequence = 0
        self._udp: Any = None
        self._runner: Any = None
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(
            target=self._loop.run_forever, name="neon-host", daemon=True
        )

    def __enter__(self) -> "NeonHost":
        self._thread.start()
        asyncio.run_coroutine_threadsafe(self._start(), self._loop).result(10)
        return self

    def __exit__(self, *exception: object) -> None:
        asyncio.run_coroutine_threadsafe(self._stop(), self._loop).result(10)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10)
        self._loop.close()

    def tell(self) -> None:
        """Send the present status to every WebSocket."""
        asyncio.run_coroutine_threadsafe(self._tell(), self._loop).result(10)

    async def _start(self) -> None:
        from aiohttp import web

        app = web.Application()
        app.router.add_get("/api/status", self._status)
        app.router.add_get("/calibration.bin", self._calibration)
        app.router.add_post("/api/event", self._event)
        app.router.add_post("/api/recording:start", self._recording)
        app.router.add_post("/api/recording:stop_and_save", self._recording)
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.1)
        await self._runner.setup()
        site = web.TCPSite(self._runner, "127.0.0.1", 0)
        await site.start()
        self.port = self._runner.addresses[0][1]
        self._rtsp = await asyncio.start_server(self._serve_rtsp, "127.0.0.1", 0)
        self._rtsp_port = self._rtsp.sockets[0].getsockname()[1]
        self._echo = await asyncio.start_server(self._serve_echo, "127.0.0.1", 0)
        self._echo_port = self._echo.sockets[0].getsockname()[1]
        self._udp, _ = await self._loop.create_datagram_endpoint(
            asyncio.DatagramProtocol, local_addr=("127.0.0.1", 0)
        )
        self._pump = asyncio.create_task(self._publish())

    async def _stop(self) -> None:
        self._pump.cancel()
        for server in (self._rtsp, self._echo):
            server.close()
        await asyncio.sleep(5 * TICK_S)  # connections just accepted get their handlers
        self._drop_all()
        for socket in list(self._sockets):
            await socket.close()
        await self._runner.cleanup()
        self._udp.close()
        others = [t for t in asyncio.all_tasks() if t is not asyncio.current_task()]
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
        await asyncio.sleep(20 * TICK_S)  # the loop closes sockets in the turns that follow

    def _drop_all(self) -> None:
        self._targets.clear()
        for writer in list(self._writers):
            writer.close()
        self._writers.clear()

    # ---- HTTP and WebSocket -----------------------------------------------------------------

    def _parts(self) -> list[Any]:
        return self._simulator.status(rtsp=self._rtsp_port, echo=self._echo_port)

    def _is_silent(self) -> bool:
        return self._simulator.source.is_unresponsive(self._clock.now_ns())

    async def _status(self, request: Any) -> Any:
        from aiohttp import web

        while self._is_silent():
            await asyncio.sleep(20 * TICK_S)
        if request.headers.get("Upgrade", "").lower() != "websocket":
            return web.json_response({"message": "Success", "result": self._parts()})
        socket = web.WebSocketResponse()
        await socket.prepare(request)
        self._sockets.add(socket)
        try:
            async for _ in socket:
                continue
        finally:
            self._sockets.discard(socket)
        return socket

    async def _calibration(self, request: Any) -> Any:
        from aiohttp import web

        return web.Response(body=self._simulator.calibration())

    async def _event(self, request: Any) -> Any:
        from aiohttp import web

        event = await request.json()
        self._simulator.events.append((event["name"], event.get("timestamp", 0)))
        recording = self._simulator.recording_id
        result = {"recording_id": recording, "timestamp": event.get("timestamp", 0)}
        return web.json_response({"message": "Success", "result": result})

    async def _recording(self, request: Any) -> Any:
        from aiohttp import web

        command = "record" if request.path.endswith("start") else "save"
        reason = self._simulator.command_recording(command)
        if reason:
            return web.json_response({"message": reason, "result": None}, status=500)
        result = {"id": self._simulator.recording_id}
        return web.json_response({"message": "Success", "result": result})

    async def _tell(self) -> None:
        for part in self._parts():
            for socket in list(self._sockets):
                await socket.send_str(json.dumps(part))

    # ---- time echo --------------------------------------------------------------------------

    async def _serve_echo(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        with contextlib.closing(writer), _ENDS:
            while True:
                asked = await reader.readexactly(8)
                if self._is_silent():
                    continue
                phone_ns = self._simulator.source.device_ns(self._clock.now_ns())
                writer.write(asked + struct.pack("!Q", phone_ns // NS_PER_MS))

    # ---- RTSP and RTP -----------------------------------------------------------------------

    async def _serve_rtsp(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._gone:
            writer.close()
            return
        self._writers.add(writer)
        with contextlib.closing(writer), _ENDS:
            while True:
                head = (await reader.readuntil(b"\r\n\r\n")).decode()
                method, url, _ = head.split(" ", 2)
                sequence = re.search(r"CSeq: *(\d+)", head, re.IGNORECASE)
                headers = [f"CSeq: {sequence[1] if sequence else 0}", "Session: 1;timeout=60"]
                body = ""
                if method == "OPTIONS":
                    headers.append("Public: OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN")
                elif method == "DESCRIBE":
                    body = SDP
                    headers += [f"Content-Base: {url}", "Content-Type: application/sdp"]
                elif method == "SETUP":
                    ports = re.search(r"client_port=(\d+)-(\d+)", head)
                    client = int(ports[1]) if ports else 0
                    mine = self._udp.get_extra_info("sockname")[1]
                    headers.append(
                        f"Transport: RTP/AVP;unicast;client_port={client}-{client + 1};"
                        f"server_port={mine}-{mine + 1};ssrc={SSRC:08X}"
                    )
                    address = ("127.0.0.1", client)
                elif method == "PLAY":
                    self._targets[writer] = address
                    self._reported_ns.pop(writer, None)
                headers.append(f"Content-Length: {len(body)}")
                lines = "\r\n".join(["RTSP/1.0 200 OK", *headers])
                writer.write(f"{lines}\r\n\r\n{body}".encode())
                if method == "TEARDOWN":
                    break
        self._targets.pop(writer, None)

    async def _publish(self) -> None:
        simulator = self._simulator
        while True:
            now_ns = self._clock.now_ns()
            is_away = simulator.source.is_away(now_ns)
            if is_away and not self._gone:
                self._drop_all()
            self._gone = is_away
            simulator.advance(now_ns)
            for message in simulator.outgoing(now_ns):
                _, stamp, payload = message.frames
                device_ns = struct.unpack_from("<q", stamp)[0]
                self._sequence = struct.unpack_from("<H", stamp, 8)[0]
                for writer, (host, port) in list(self._targets.items()):
                    if now_ns - self._reported_ns.get(writer, -(2**62)) > REPORT_EVERY_NS:
                        self._reported_ns[writer] = now_ns
                        self._udp.sendto(self._report(device_ns), (host, port + 1))
                        await asyncio.sleep(TICK_S)  # the client must read it first
                    self._udp.sendto(self._packet(device_ns, payload), (host, port))
            await asyncio.sleep(TICK_S)

    def _packet(self, device_ns: int, payload: bytes) -> bytes:
        return struct.pack("!BBHII", 0x80, 96, self._sequence, _ticks(device_ns), SSRC) + payload

    def _report(self, device_ns: int) -> bytes:
        seconds, rest_ns = divmod(device_ns, NS_PER_S)
        fraction = (rest_ns << 32) // NS_PER_S
        return struct.pack(
            "!BBHIIIIII",
            0x80,
            200,
            6,
            SSRC,
            seconds + NTP_AHEAD_S,
            fraction,
            _ticks(device_ns),
            0,
            0,
        )


def _ticks(device_ns: int) -> int:
    return (device_ns - EPOCH_NS) * RTP_HZ // NS_PER_S & 0xFFFFFFFF
