"""The key file of a study, apart from the data: who is behind a label, and the study's salt."""

import hashlib
import hmac
import os
import re
import secrets
import stat
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from visavis.lab.errors import LedgerError
from visavis.protocol.people.file_lock import locked
from visavis.recording.durable import replace_secret
from visavis.recording.sealed import read_sealed, seal

FORMAT_VERSION = 2
"""Key files of this version and later end in their own checksum."""


class KeyFile:
    """The key file `<key_root>/<study>.json`, created with a new salt, for its owner only.

    Raises LedgerError when `key_root` lies inside one of `data_roots`, or when others may read
    the file.
    """

    def __init__(self, key_root: Path, study: str, data_roots: Sequence[Path]) -> None:
        for root in data_roots:
            if key_root.resolve().is_relative_to(root.resolve()):
                raise LedgerError(
                    f"key_root {key_root} lies inside the data root {root}: whoever copies the "
                    "data would copy who is who; set key_root to a folder outside it"
                )
        self.path = key_root / f"{study}.json"
        self._lock_path = key_root / f".{study}.lock"
        self._study = study
        _make_private_folder(key_root)
        with locked(self._lock_path):
            if not self.path.exists():
                salt = secrets.token_hex(32)
                self._write({"study": study, "salt": salt, "identities": {}})
        self._read()

    def pseudonym(self, label: str) -> str:
        """Return the name under which data are shared: 12 hex digits that only the salt links."""
        salt = bytes.fromhex(self._read()["salt"])
        return hmac.new(salt, label.encode(), hashlib.sha256).hexdigest()[:12]

    def page_key(self, label: str, session: int) -> str:
        """Return the secret in the address of a session's page, the same whenever it is asked."""
        return self._secret(f"page/{label}/{session}")

    def board_key(self) -> str:
        """Return the secret in the address of the study's board, the same whenever it is asked."""
        return self._secret("board/")

    def _secret(self, message: str) -> str:
        salt = bytes.fromhex(self._read()["salt"])
        # labels hold letters and digits only, no slash, so no pseudonym is made from the same text
        return hmac.new(salt, message.encode(), hashlib.sha256).hexdigest()

    def identify(self, label: str, identity: Mapping[str, str]) -> None:
        """Store who is behind a label (name, contact); replaces what was stored."""
        with locked(self._lock_path):
            content = self._read()
            content["identities"][label] = dict(identity)
            self._write(content)

    def identity(self, label: str) -> Mapping[str, str] | None:
        """Return who is behind a label; None when nobody was stored."""
        person: Mapping[str, str] | None = self._read()["identities"].get(label)
        return person

    def forget(self, label: str) -> bool:
        """Remove who is behind a label; tells whether anybody was stored."""
        with locked(self._lock_path):
            content = self._read()
            if content["identities"].pop(label, None) is None:
                return False
            self._write(content)
        return True

    def rename(self, label: str, new_label: str) -> bool:
        """Store who is behind a label under its corrected one; tells whether anybody was stored."""
        with locked(self._lock_path):
            content = self._read()
            identity = content["identities"].pop(label, None)
            if identity is None:
                return False
            content["identities"][new_label] = identity
            self._write(content)
        return True

    def _read(self) -> dict[str, Any]:
        try:
            mode = stat.S_IMODE(self.path.stat().st_mode)
            sealed_file = read_sealed(self.path)
            content = sealed_file.content
            if not sealed_file.is_sealed and content.get("format", 1) != 1:
                raise ValueError("it lost its checksum")
        except (OSError, ValueError) as error:
            raise LedgerError(
                f"the key file {self.path} cannot be read ({error}); restore it from its backup"
            ) from error
        if os.name != "nt" and mode & 0o077:
            raise LedgerError(
                f"the key file {self.path} can be read by others (mode {mode:04o}); "
                f"protect it: chmod 600 '{self.path}'"
            )
        salt, identities = content.get("salt"), content.get("identities")
        is_whole = isinstance(salt, str) and re.fullmatch(r"([0-9a-f]{2})+", salt) is not None
        if not is_whole or not isinstance(identities, dict):
            raise LedgerError(
                f"the key file {self.path} lacks its salt or identities; restore it from its backup"
            )
        return content

    def _write(self, content: Mapping[str, Any]) -> None:
        try:
            replace_secret(self.path, seal({**content, "format": FORMAT_VERSION}))
        except OSError as error:
            raise LedgerError(
                f"the key file {self.path} cannot be written: {error.strerror}; check the disk "
                "and that the folder is yours"
            ) from error


def _make_private_folder(key_root: Path) -> None:
    try:
        if not key_root.exists():
            key_root.mkdir(parents=True, mode=0o700)
            # keeps identities out of a repository the folder may stand in
            (key_root / ".gitignore").write_text("*\n", encoding="utf-8")
    except OSError as error:
        raise LedgerError(
            f"key_root {key_root} cannot be created: {error.strerror}; choose another folder in "
            "lab_config.yaml"
        ) from error
