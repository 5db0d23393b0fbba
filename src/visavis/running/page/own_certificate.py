"""A certificate that this computer makes for itself, for https on a laboratory's network."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from visavis.lab.errors import UsageError
from visavis.recording.durable import replace_secret
from visavis.running.page.lan import Certificate, certificate_of

NAME: Final = "lan-certificate.pem"
AGE: Final = timedelta(days=397)
"""Browsers refuse certificates that are valid for longer than 398 days."""


def own_certificate(folder: Path, names: Sequence[str], now: datetime) -> Certificate:
    """Return a folder's certificate for these names and addresses, the same as long as it holds.

    Made anew where it is missing, too old, or not for all of them; its file, readable for its owner
    alone, holds the key as well. `now` is the time of day, with its zone.
    """
    path = folder / NAME
    if path.is_file():  # a pipe would be waited for
        try:
            return certificate_of(path, path, names)
        except UsageError:
            pass  # the computer has another address by now, or a year has passed
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    replace_secret(path, _make(names, now.astimezone(UTC)))
    return certificate_of(path, path, names)


def _make(names: Sequence[str], now: datetime) -> bytes:
    """Return a new key and a certificate for it, signed by itself, as PEM."""
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "Visavis on this network")])
    certificate = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))
        .not_valid_after(now + AGE)
        .add_extension(
            x509.SubjectAlternativeName([_general_name(n) for n in names]), critical=False
        )
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .sign(key, hashes.SHA256())
    )
    return key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    ) + certificate.public_bytes(serialization.Encoding.PEM)


def _general_name(name: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ip_address(name))
    except ValueError:
        return x509.DNSName(name)
