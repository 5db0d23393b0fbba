"""How browsers on other devices reach a server here: addresses, certificates and the code."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from visavis.lab.clock import Clock
from visavis.lab.errors import ConfigError, UsageError
from visavis.running.page.lan import Certificate, addresses_here, certificate_of

EVERYWHERE: Final = ("0.0.0.0", "::")  # noqa: S104  # refused without a name to come under

LOOPBACK: Final = ("127.0.0.1", "localhost")
DEFAULT_HOST: Final = LOOPBACK[0]


@dataclass(frozen=True)
class Way:
    """How people's browsers reach a server.

    `public` is the address that whoever serves gave, `host` and `port` are where it listens. With
    `is_lan` it speaks https on the lab's network, by the `certificate` and `key` of the lab or by
    one of its own.
    """

    public: str
    host: str
    port: int
    is_lan: bool = False
    certificate: Path | None = None
    key: Path | None = None

    @property
    def name(self) -> str:
        """The name in the address that was given, "" without one."""
        return urlsplit(self.public).hostname or ""

    @property
    def is_insecure(self) -> bool:
        """Whether browsers take the given address for no safe one, as they do http of a network."""
        return urlsplit(self.public).scheme == "http" and self.name not in LOOPBACK

    def other_port(self, port: int) -> str:
        """Return what to say where people's browsers come to another port than is listened at with
        `is_lan`; "" where they do not.
        """
        parts = urlsplit(self.public)
        at_port = parts.port or 443
        if not self.is_lan or not self.public or at_port == port:
            return ""
        return (
            f"{self.public} leads browsers to port {at_port}, and this listens at {port}: unless "
            f"something leads from there to here, say --public https://{parts.hostname}:{port}"
        )

    def check(self) -> None:
        """Check that the options fit together.

        Raises:
            UsageError: saying which do not, and what to do.
        """
        parts = urlsplit(self.public)
        if self.public and (parts.scheme not in ("http", "https") or not parts.hostname):
            raise UsageError(f"--public takes an address, https://…, not {self.public!r}")
        if parts.path.strip("/") or parts.query or parts.fragment:
            raise UsageError(
                f"--public takes the name of a server alone, not {self.public!r}: pages lie at "
                "its root"
            )
        if self.is_lan:
            if self.public and parts.scheme != "https":
                raise UsageError(f"--lan speaks https; say --public https://{parts.netloc}")
            if (self.certificate is None) != (self.key is None):
                raise UsageError("--certificate and --key go together: two PEM files")
            if self.certificate is not None and not self.public:
                raise UsageError(
                    "say with --public which name of the certificate people type, such as "
                    f"--public https://study.example.org:{self.port}"
                )
        elif self.certificate is not None or self.key is not None:
            raise UsageError("--certificate and --key are for --lan; without it a proxy has them")
        elif self.host in EVERYWHERE and not self.public:
            raise UsageError(
                f"--host {self.host} listens to other computers; say with --public under which "
                "address they come, such as http://192.168.1.5:8080, or use --lan"
            )


@dataclass(frozen=True)
class Listening:
    """Where a server listens, and under which names: `near` are addresses of the network alone."""

    host: str
    near: tuple[str, ...]
    names: tuple[str, ...]
    certificate: Certificate | None


def listening_of(way: Way, key_root: Path, clock: Clock) -> Listening:
    """Return where a server listens for a way in, with the certificate that it shows on a network.

    A certificate of its own lies in `key_root`; `clock` says whether it still holds.

    Raises:
        UsageError: this computer is on no network, or the lab's own certificate does not hold.
        ConfigError: none can be made, as a library is not installed.
    """
    listens_everywhere = way.host in EVERYWHERE or (way.is_lan and way.host == DEFAULT_HOST)
    near = (addresses_here() if listens_everywhere else (way.host,)) if way.is_lan else ()
    if way.is_lan and not (way.name or near):
        raise UsageError("this computer has no address on a network; join one")
    names = tuple(dict.fromkeys(filter(None, (way.name, *near, *LOOPBACK))))
    certificate = _certificate(way, names, key_root, clock) if way.is_lan else None
    host = EVERYWHERE[0] if way.is_lan and listens_everywhere else way.host
    return Listening(host, near, (*names, way.host), certificate)


def words_of_code(way: Way, digits: str, certificate: Certificate | None) -> Iterator[str]:
    """Yield what whoever serves reads: the code, and how to know the server again by https."""
    yield "Code that opens a session:"
    yield f"  [b]{digits[:3]} {digits[3:]}[/]"
    if certificate is None:
        return
    if way.certificate is None:
        yield (
            "Browsers warn, as this computer made its certificate itself: go on (Advanced) if the "
            "one they show has this SHA-256:"
        )
    else:
        yield "SHA-256 of the certificate:"
    half = len(certificate.fingerprint) // 2
    yield f"  {certificate.fingerprint[:half]}"
    yield f"  {certificate.fingerprint[half + 1 :]}"


def _certificate(way: Way, names: tuple[str, ...], key_root: Path, clock: Clock) -> Certificate:
    if way.certificate is not None and way.key is not None:
        return certificate_of(way.certificate, way.key, [way.name])
    try:
        # cryptography comes with visavis[lan], which whoever has a certificate does not need.
        from visavis.running.page.own_certificate import own_certificate
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"a certificate of its own needs {error.name}, which is not installed; run: pip "
            "install 'visavis[lan]', or give `visavis serve` the lab's with --certificate and "
            "--key, or join one headset by cable and serve without --lan (adb reverse tcp:8080 "
            "tcp:8080)"
        ) from error
    return own_certificate(key_root, names, datetime.fromisoformat(clock.wall_iso()))
