"""Read `lab_config.yaml`: one lab, its folders, its devices by role; wrong in full or right."""

import difflib
import hashlib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field

from lab.model_problems import model_problems
from lab.units import explain_magnitude, explain_text, unit_of
from lab.yaml_lines import (
    Document,
    KeyPath,
    Problem,
    ProblemsError,
    did_you_mean,
    parse_document,
    read_document,
)

ROLES = ("headset", "eye_tracker", "responses", "body_tracker")
ARMBAND_ROLE = re.compile(r"armband_[a-z0-9_]+")
TAKEN_STREAMS = frozenset(
    {
        "gaze", "head", "body", "frames", "frame_timing", "pointer", "haptics", "band", "events",
        "trials", "openness", "scene_states", "gaze_targets", "drawn", "drawn_views",
    }
)  # fmt: skip
"""Streams and tables of Visavis: a device of the lab's own is called by another name."""
OWN_ROLE = re.compile(r"[a-z][a-z0-9_]{1,40}")
MISSPELT_01 = 0.8
"""A role as like one of ours as this is taken for misspelt; others are the lab's own."""

OptionModels: TypeAlias = Mapping[str, type[BaseModel]]
"""Option models by driver name; only these drivers are then known."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Room(_Part):
    """The room the participant moves in."""

    name: str = ""
    width_m: float | None = Field(default=None, gt=0, le=100)
    depth_m: float | None = Field(default=None, gt=0, le=100)


class Display(_Part):
    """Where the scene is drawn: nowhere (geometry only), in a window, in the headset, or as
    pictures that nobody sees (offscreen); where questionnaires are asked; as whom participants see
    themselves where a body tracker follows them; and how long light takes to go when a scene ends
    and to come when one begins. A scene that comes slowly has no onset to time from.
    """

    show: Literal["none", "window", "headset", "offscreen"] = "none"
    questions: Literal["terminal", "headset"] = "terminal"
    own_body: Literal["none", "female", "male"] = "none"
    fade_out_ms: float = Field(default=200.0, ge=0, le=3000)
    fade_in_ms: float = Field(default=0.0, ge=0, le=3000)
    window_width_px: int = Field(default=1280, ge=160, le=16384)
    window_height_px: int = Field(default=720, ge=120, le=16384)


class Sync(_Part):
    """Whether sessions stream to Lab Streaming Layer while they run, and who may meet them.

    Without `session_id` streams are in the session in which LSL's programs, LabRecorder among
    them, look for them; a lab that wants its own sets it in those programs, too.
    """

    lsl: bool = False
    this_computer_only: bool = False
    session_id: str = ""


class Privacy(_Part):
    """What participants agreed to; the version is recorded with every session.

    Recordings are for the account that made them alone; with `group`, for that group of the
    computer's accounts, too.
    """

    consent_version: str = Field(min_length=1)
    contact: str = ""
    group: str = ""


class Publication(_Part):
    """What data sets that leave the lab say of themselves: who, where, under which licence."""

    authors: tuple[str, ...] = Field(default=(), strict=False)
    licence: str = ""
    how_to_acknowledge: str = ""
    funding: tuple[str, ...] = Field(default=(), strict=False)
    ethics_approvals: tuple[str, ...] = Field(default=(), strict=False)
    references: tuple[str, ...] = Field(default=(), strict=False)
    institution: str = ""
    institution_address: str = ""
    department: str = ""


class DeviceConfig(BaseModel):
    """One role: which driver fills it, on a real or a simulated wire, with which options.

    `options` holds every other key; with an option model, its defaults too.
    """

    model_config = ConfigDict(frozen=True)

    role: str
    driver: str
    simulated: bool
    options: Mapping[str, Any]


class LabConfig(BaseModel):
    """One lab. Paths are absolute; `text` is the file as read and `sha256` its hash (hex)."""

    model_config = ConfigDict(frozen=True)

    lab: str
    data_root: Path
    key_root: Path
    room: Room
    display: Display
    privacy: Privacy
    publication: Publication = Publication()
    sync: Sync = Sync()
    devices: Mapping[str, DeviceConfig]
    wording: Mapping[str, Path]
    studies: Mapping[str, Path] = Field(default_factory=dict)
    language: str = "en"
    path: Path
    text: str

    @property
    def sha256(self) -> str:
        """SHA-256 of the file's text in UTF-8."""
        return hashlib.sha256(self.text.encode("utf-8")).hexdigest()


class _File(_Part):
    """The file as written, before paths and devices are resolved."""

    lab: str = Field(min_length=1)
    data_root: str = Field(min_length=1)
    key_root: str = Field(min_length=1)
    room: Room = Room()
    display: Display = Display()
    privacy: Privacy
    publication: Publication = Publication()
    sync: Sync = Sync()
    devices: dict[str, Any] = Field(min_length=1)
    wording: dict[str, str] = Field(default_factory=dict)
    studies: dict[str, str] = Field(default_factory=dict)
    language: str = Field(default="en", min_length=2)


def load_config(path: Path, option_models: OptionModels | None = None) -> LabConfig:
    """Read and validate a lab configuration.

    Raises `lab.yaml_lines.ProblemsError` (a ConfigError) with everything that is wrong.
    """
    return _validated(read_document(path), option_models)


def parse_config(
    text: str,
    path: Path,
    option_models: OptionModels | None = None,
    *,
    folder: Path | None = None,
) -> LabConfig:
    """Validate a configuration given as text, such as the copy kept with a session.

    Relative paths in it are relative to `folder`, the folder of `path` when left out.
    """
    return _validated(parse_document(text, path), option_models, folder)


def with_devices(config: LabConfig, kind: Literal["sim", "real"]) -> LabConfig:
    """Put every role on a simulated wire, or every role on its real one."""
    devices = {
        role: device.model_copy(update={"simulated": kind == "sim"})
        for role, device in config.devices.items()
    }
    return config.model_copy(update={"devices": devices})


def _validated(
    document: Document, option_models: OptionModels | None, folder: Path | None = None
) -> LabConfig:
    folder = folder or document.path.absolute().parent
    problems = list(document.problems)
    raw = document.data
    if not isinstance(raw, dict):
        problems.append(document.problem((), "expects settings such as `lab: NAME`"))
        raise ProblemsError(document.path, problems)
    problems += model_problems(document, _File, raw, ())
    devices = raw.get("devices")
    entries: dict[str, DeviceConfig] = {}
    if isinstance(devices, dict):
        for role, entry in devices.items():
            checked = _device(document, role, entry, option_models, problems)
            if checked is not None:
                entries[checked.role] = checked
    paths = {
        key: _absolute(folder, str(raw[key])) for key in ("data_root", "key_root") if raw.get(key)
    }
    if len(paths) == 2 and paths["key_root"].is_relative_to(paths["data_root"]):
        message = (
            f"lies in data_root ({paths['data_root']}): whoever copies the data would copy who is "
            "who; choose a folder outside it"
        )
        problems.append(document.problem(("key_root",), message))
    if problems:
        raise ProblemsError(document.path, problems)
    file = _File.model_validate(raw)
    return LabConfig(
        lab=file.lab,
        room=file.room,
        display=file.display,
        privacy=file.privacy,
        publication=file.publication,
        sync=file.sync,
        devices=entries,
        wording={name: _absolute(folder, text) for name, text in file.wording.items()},
        studies={name: _absolute(folder, text) for name, text in file.studies.items()},
        language=file.language,
        path=document.path.absolute(),
        text=document.text,
        **paths,
    )


def _absolute(folder: Path, text: str) -> Path:
    return (folder / Path(text).expanduser()).resolve()


def is_own_role(role: str) -> bool:
    """Say whether the lab named the role itself: what fills it is recorded beside every study."""
    return role not in ROLES and not ARMBAND_ROLE.fullmatch(role)


def _device(
    document: Document,
    role: object,
    entry: object,
    option_models: OptionModels | None,
    problems: list[Problem],
) -> DeviceConfig | None:
    """Check one role; adds what is wrong to `problems`."""
    at: KeyPath = ("devices", str(role))
    if is_own_role(str(role)):
        if difflib.get_close_matches(str(role), ROLES, n=1, cutoff=MISSPELT_01):
            problems.append(document.problem(at, f"unknown role{did_you_mean(role, ROLES)}"))
        elif str(role) in TAKEN_STREAMS or not OWN_ROLE.fullmatch(str(role)):
            problems.append(
                document.problem(
                    at, "cannot be a role: small letters, digits and _, and no stream of Visavis"
                )
            )
    if not isinstance(entry, dict):
        problems.append(document.problem(at, "expects settings such as {driver: NAME}"))
        return None
    options = {str(k): v for k, v in entry.items() if k not in ("driver", "simulated")}
    simulated = entry.get("simulated", False)
    if not isinstance(simulated, bool):
        problems.append(document.problem((*at, "simulated"), f"is {simulated!r}; true or false"))
    driver = entry.get("driver")
    if not isinstance(driver, str):
        said = "is missing" if "driver" not in entry else f"is {driver!r}"
        near = did_you_mean("", option_models or ())
        problems.append(document.problem((*at, "driver"), f"{said}; name the driver{near}"))
        return None
    if option_models is not None and driver not in option_models:
        hint = did_you_mean(driver, option_models)
        problems.append(document.problem((*at, "driver"), f"unknown driver {driver!r}{hint}"))
        return None
    if option_models is None:
        problems += [
            document.problem((*at, key), message)
            for key, value in options.items()
            if (message := _unit_doubt(key, value))
        ]
    else:
        model = option_models[driver]
        found = model_problems(document, model, options, at, also_known=("driver", "simulated"))
        problems += found
        if not found:
            options = {**options, **model.model_validate(options).model_dump()}
    return DeviceConfig(role=str(role), driver=driver, simulated=simulated is True, options=options)


def _unit_doubt(key: str, value: object) -> str | None:
    """Doubt the unit of an option nobody has described."""
    if unit_of(key) and isinstance(value, str):
        return explain_text(key, value)
    return explain_magnitude(key, value)
