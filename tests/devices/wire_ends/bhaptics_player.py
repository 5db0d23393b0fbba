"""The port of a bHaptics Player, to which the maker's own SDK connects: TLS, then a WebSocket.

It grants every application, tells one unit on the left forearm, and keeps what was sent.
"""

import contextlib
import json
import ssl
import threading
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from visavis.lab.closing import Closing

UNIT = {
    "position": 1,
    "deviceName": "TactSleeve",
    "address": "c4:d8:00:00:00:01",
    "connected": True,
    "paired": True,
    "battery": 77,
    "audioJackIn": False,
    "vsm": 0,
}


def certificate(folder: Path) -> tuple[Path, Path]:
    """Write a certificate that signs itself, as a Player's does; return it and its key."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import rsa

    key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    name = x509.Name([x509.NameAttribute(x509.oid.NameOID.COMMON_NAME, "localhost")])
    day = datetime(2026, 1, 1, tzinfo=UTC)
    built = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(1)
        .not_valid_before(day)
        .not_valid_after(day + timedelta(days=36_500))
        .sign(key, hashes.SHA256())
    )
    paths = folder / "player.pem", folder / "player-key.pem"
    paths[0].write_bytes(built.public_bytes(serialization.Encoding.PEM))
    paths[1].write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.TraditionalOpenSSL,
            serialization.NoEncryption(),
        )
    )
    return paths


class BhapticsPlayer(Closing):
    """Serve until closed; a context manager. `requests` are (type, message) as they came."""

    def __init__(self, folder: Path, port: int) -> None:
        import websockets.exceptions
        import websockets.sync.server

        self.paths: list[str] = []
        self.requests: list[tuple[str, str]] = []
        self._gone = websockets.exceptions.ConnectionClosed
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(*certificate(folder))
        self._server: Any = websockets.sync.server.serve(
            self._serve, "127.0.0.1", port, ssl=context, compression=None, close_timeout=0.2
        )
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._thread.join()

    def _serve(self, connection: Any) -> None:
        self.paths.append(connection.request.path)
        with contextlib.suppress(self._gone):
            for text in connection:
                message = json.loads(text)
                self.requests.append((message["Type"], message["Message"]))
                if message["Type"] == "SdkRequestAuth":
                    for kind, said in (("ServerReady", ""), ("ServerDevices", json.dumps([UNIT]))):
                        connection.send(json.dumps({"Type": kind, "Message": said}))
