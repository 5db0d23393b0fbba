"""Pages on a laboratory's network: this computer's addresses there, and the certificate of https.

Browsers enter a headset, and check the files that they load, only at an address that is secure.
"""

import hashlib
import re
import socket
import ssl
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from typing import Final

from visavis.lab.errors import UsageError

SOMEWHERE_ELSE: Final = ("192.0.2.1", 9)
"""An address of RFC 5737 that nobody has: the way to it leaves by the network in use."""
CERTIFICATE: Final = re.compile(r"-----BEGIN CERTIFICATE-----.+?-----END CERTIFICATE-----", re.S)


@dataclass(frozen=True)
class Certificate:
    """What a server of https shows: its files, and the SHA-256 by which people recognise it."""

    context: ssl.SSLContext
    fingerprint: str


def addresses_here() -> tuple[str, ...]:
    """Return the IPv4 addresses under which other computers reach this one, the usual one first."""
    found = []
    with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as way:
        way.connect(SOMEWHERE_ELSE)  # nothing is sent
        found.append(str(way.getsockname()[0]))
    with suppress(OSError):
        found += socket.gethostbyname_ex(socket.gethostname())[2]
    near = (ip_address(text) for text in dict.fromkeys(found))
    return tuple(str(a) for a in near if not (a.is_loopback or a.is_unspecified))


def certificate_of(certificate: Path, key: Path, names: Iterable[str]) -> Certificate:
    """Read a certificate and its key (PEM), which must be for all of these names or addresses.

    Raises:
        UsageError: they cannot be read or do not belong together, or a browser would refuse them
            under a name, or now.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, key, password=lambda: b"")
    except (OSError, ValueError) as error:  # ssl.SSLError is one
        raise UsageError(
            f"{certificate} and {key} are no certificate and its key ({error}); both are PEM "
            "files, the key without a password"
        ) from error
    for name in names:
        if why := _why_refused(context, certificate, name):
            raise UsageError(f"{certificate} does not hold for {name}: {why}")
    (first, *_) = CERTIFICATE.findall(certificate.read_text("ascii", "replace"))
    digest = hashlib.sha256(ssl.PEM_cert_to_DER_cert(first)).hexdigest().upper()
    return Certificate(context, ":".join(digest[i : i + 2] for i in range(0, len(digest), 2)))


def _why_refused(context: ssl.SSLContext, certificate: Path, name: str) -> str:
    """Return why who trusts the certificate itself would still refuse it; "" where nobody does."""
    client = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    client.load_verify_locations(certificate)
    client.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
    there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = [
        client.wrap_bio(back, there, server_hostname=name),
        context.wrap_bio(there, back, server_side=True),
    ]
    try:
        while ends:
            for end in list(ends):
                with suppress(ssl.SSLWantReadError):
                    end.do_handshake()
                    ends.remove(end)
    except ssl.SSLCertVerificationError as error:
        return str(error.verify_message)
    except ssl.SSLError as error:
        return str(error.reason)
    return ""
