"""Read `lab_config.yaml`: a lab's folders and devices by role; all mistakes come together."""

import difflib
import hashlib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from visavis.lab.luminance import LuminanceTable, read_luminance
from visavis.lab.model_problems import model_problems
from visavis.lab.screen import FlatScreen
from visavis.lab.units import explain_magnitude, explain_text, unit_of
from visavis.lab.yaml_lines import (
    Document,
    KeyPath,
    Problem,
    ProblemsError,
    did_you_mean,
    parse_document,
    read_document,
)

ROLES = ("headset", "eye_tracker", "responses", "body_tracker", "sound")
ARMBAND_ROLE = re.compile(r"armband_[a-z0-9_]+")
TAKEN_STREAMS = frozenset(
    {
        "gaze", "head", "head_measured", "body", "frames", "frame_timing", "pointer", "haptics",
        "band", "events", "trials", "openness", "scene_states", "gaze_targets", "drawn",
        "drawn_gpu", "drawn_views", "gaze_window",
    }
)  # fmt: skip
"""Names of Visavis' own streams and tables; a lab's own device needs another name."""
OWN_ROLE = re.compile(r"[a-z][a-z0-9_]{1,40}")
MISSPELT_01 = 0.8
"""Similarity from which an unknown role counts as ours, misspelt; others are the lab's own."""

OptionModels: TypeAlias = Mapping[str, type[BaseModel]]
"""Option models by driver name; only these drivers are then known."""


INCIDENTS: Mapping[str, str] = {
    "unwell": "the participant is unwell",
    "wish": "the participant asked for it",
    "inattentive": "the participant did not do the task",
    "misunderstood": "the task was misunderstood",
    "fit": "headset, tracker or band slipped",
    "device": "a device did not work",
    "disturbance": "noise, or somebody came in",
    "operator": "the operator made a mistake",
    "other": "something else",
}
"""Why trials are skipped or flagged and sessions paused, by code; a lab may list its own."""
MAX_INCIDENTS = 9
"""Each has a key from 1 to 9."""
INCIDENT = re.compile(r"[a-z][a-z0-9_]{1,30}")


CHARACTERS = "characters"
"""Folder of a lab's own people below its data root."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Room(_Part):
    """The room the participant moves in."""

    name: str = ""
    width_m: float | None = Field(default=None, gt=0, le=100)
    depth_m: float | None = Field(default=None, gt=0, le=100)


class Screen(_Part):
    """A monitor that participants look at: its lit area, its pixels, and where the eyes are.

    `distance_m` leads from the eyes straight ahead to the screen's plane; `center_right_m` and
    `center_up_m` say where the screen's middle stands as seen from there; `eye_height_m` is that
    of the eyes above the floor of the scene. The head is fixed there (chin rest), or tracked: the
    picture then follows the eyes that the eye tracker finds. Not `fullscreen` it is a window for
    trying things out. `monitor` counts from 0.
    """

    width_m: float = Field(gt=0.05, le=20)
    height_m: float = Field(gt=0.05, le=20)
    width_px: int = Field(ge=160, le=16384)
    height_px: int = Field(ge=120, le=16384)
    distance_m: float = Field(ge=0.1, le=50)
    rate_hz: float = Field(default=60.0, ge=10, le=1000)
    eye_height_m: float = Field(default=1.2, ge=0.2, le=2.5)
    center_right_m: float = Field(default=0.0, ge=-5, le=5)
    center_up_m: float = Field(default=0.0, ge=-5, le=5)
    head: Literal["fixed", "tracked"] = "fixed"
    fullscreen: bool = True
    monitor: int = Field(default=0, ge=0, le=16)

    @model_validator(mode="after")
    def _is_ahead(self) -> "Screen":
        if (
            abs(self.center_right_m) >= self.width_m / 2
            or abs(self.center_up_m) >= self.height_m / 2
        ):
            raise ValueError(
                "straight ahead the eyes see past the screen: center_right_m and center_up_m must "
                "be less than half its width and height"
            )
        return self

    @property
    def flat(self) -> FlatScreen:
        """The screen as seen from the viewing place."""
        return FlatScreen(
            self.width_m,
            self.height_m,
            self.width_px,
            self.height_px,
            self.distance_m,
            self.center_right_m,
            self.center_up_m,
        )

    @property
    def identity(self) -> str:
        """The words by which a table of luminances says which screen it belongs to."""
        return (
            f"{self.width_px} x {self.height_px} px {self.width_m:g} x {self.height_m:g} m "
            f"monitor {self.monitor}"
        )

    def as_options(self) -> dict[str, float]:
        """Return the screen's settings for a screen-based eye tracker (mm, pixels)."""
        return {
            "screen_width_px": self.width_px,
            "screen_height_px": self.height_px,
            "screen_width_mm": round(self.width_m * 1e3, 6),
            "screen_height_mm": round(self.height_m * 1e3, 6),
            "screen_distance_mm": round(self.distance_m * 1e3, 6),
            "screen_center_right_mm": round(self.center_right_m * 1e3, 6),
            "screen_center_up_mm": round(self.center_up_m * 1e3, 6),
        }


class DrawingQuality(_Part):
    """How much work pictures are worth; what is left out suits the computer.

    `samples` a pixel smooth edges. `render_scale` is how many pixels are drawn for one that the
    headset asks for, along each side. Faces of at least `full_detail_px` pixels have all their
    triangles. `shadows` are maps of `shadow_map_px`; with `area` those of lamps with a size, sharp
    where things touch and softer farther away; shade under the feet alone (blobs); or none. A
    processor draws blobs where maps or area are asked for.
    """

    samples: Literal[0, 2, 4, 8] | None = None
    render_scale: float = Field(default=1.0, ge=0.5, le=2.0)
    full_detail_px: float | None = Field(default=None, ge=1, le=1000)
    shadows: Literal["maps", "area", "blobs", "none"] | None = None
    shadow_map_px: Literal[512, 1024, 2048, 4096] | None = None


class Display(_Part):
    """Where the scene is drawn: nowhere (geometry only), in a window, in the headset, on a screen
    participants sit before, or as pictures that nobody sees (offscreen); where questionnaires are
    asked; as whom participants see themselves where a body tracker follows them; and how long
    light takes to go when a scene ends and to come when one begins; what pictures are worth. A
    scene that comes slowly has no onset to time from.
    """

    show: Literal["none", "window", "headset", "screen", "offscreen"] = "none"
    screen: Screen | None = None
    questions: Literal["terminal", "headset", "screen"] = "terminal"
    own_body: Literal["none", "female", "male"] = "none"
    fade_out_ms: float = Field(default=200.0, ge=0, le=3000)
    fade_in_ms: float = Field(default=0.0, ge=0, le=3000)
    window_width_px: int = Field(default=1280, ge=160, le=16384)
    window_height_px: int = Field(default=720, ge=120, le=16384)
    quality: DrawingQuality = DrawingQuality()

    @model_validator(mode="after")
    def _has_a_screen(self) -> "Display":
        if self.show == "screen" and self.screen is None:
            raise ValueError(
                "show: screen needs the screen's size, pixels and distance under display.screen"
            )
        return self

    @property
    def on_screen(self) -> Screen | None:
        """The screen that stands in the place of a headset; None where there is a headset."""
        return None if self.show in ("window", "headset") else self.screen


class Sync(_Part):
    """Whether sessions stream to Lab Streaming Layer while they run, and who may meet them.

    Without `session_id` streams are in the session in which LSL's programs, LabRecorder among
    them, look for them; a lab that wants its own sets it in those programs, too. `lab_recorder`
    (HOST or HOST:PORT) is started and stopped with every session.
    """

    lsl: bool = False
    this_computer_only: bool = False
    session_id: str = ""
    lab_recorder: str = ""


class GazeChecks(_Part):
    """When a session that calibrates gaze checks its drift, and how much of it is let pass.

    After every `drift_check_trials` trials (0: only when the operator asks) one target is looked
    at; gaze further off than `drift_limit_deg` is calibrated anew.
    """

    drift_check_trials: int = Field(default=0, ge=0, le=1000)
    drift_limit_deg: float = Field(default=2.0, gt=0, le=20)


class Privacy(_Part):
    """What participants agreed to; the version is recorded with every session.

    Recordings are for the account that made them alone; with `group`, for that group of the
    computer's accounts, too.
    """

    consent_version: str = Field(min_length=1)
    contact: str = ""
    group: str = ""


class Publication(_Part):
    """What published data sets say about themselves: authors, place and licence."""

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
    """One lab. Paths are absolute; `text` is the file as read and `sha256` its hash (hex).

    `cast` names who plays the studies' people (nobody: those who come with Visavis), from those
    imported into `characters`, which stays the lab's when a command writes its data elsewhere.
    `incidents` are the reasons an operator may give, in words by their codes.
    """

    model_config = ConfigDict(frozen=True)

    lab: str
    data_root: Path
    key_root: Path
    room: Room
    display: Display
    privacy: Privacy
    publication: Publication = Publication()
    sync: Sync = Sync()
    gaze: GazeChecks = GazeChecks()
    devices: Mapping[str, DeviceConfig]
    wording: Mapping[str, Path]
    studies: Mapping[str, Path] = Field(default_factory=dict)
    cast: tuple[str, ...] = ()
    characters: Path
    language: str = "en"
    incidents: Mapping[str, str] = Field(default_factory=lambda: dict(INCIDENTS))
    path: Path
    text: str

    @property
    def sha256(self) -> str:
        """SHA-256 of the file's text in UTF-8."""
        return hashlib.sha256(self.text.encode("utf-8")).hexdigest()

    @property
    def luminance_path(self) -> Path:
        """Where the luminances of its screen are written."""
        return self.path.with_name(f"{self.path.stem}.luminance.csv")

    @property
    def luminance(self) -> LuminanceTable | None:
        """The luminances that were measured on its screen; None without.

        Raises:
            ConfigError: their table cannot be used.
        """
        screen = self.display.on_screen
        if screen is None or not self.luminance_path.exists():
            return None
        return read_luminance(self.luminance_path, screen.identity)


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
    gaze: GazeChecks = GazeChecks()
    devices: dict[str, Any] = Field(min_length=1)
    wording: dict[str, str] = Field(default_factory=dict)
    studies: dict[str, str] = Field(default_factory=dict)
    cast: list[str] = Field(default_factory=list)
    language: str = Field(default="en", min_length=2)
    incidents: dict[str, str] = Field(
        default_factory=lambda: dict(INCIDENTS), min_length=1, max_length=MAX_INCIDENTS
    )

    @field_validator("incidents")
    @classmethod
    def _are_codes(cls, texts: dict[str, str]) -> dict[str, str]:
        for code, words in texts.items():
            if not INCIDENT.fullmatch(code):
                raise ValueError(
                    f"{code!r} is not a code: small letters, digits and _, such as participant_late"
                )
            if not words.strip():
                raise ValueError(f"{code} says nothing; write in words what it stands for")
        return texts


def load_config(path: Path, option_models: OptionModels | None = None) -> LabConfig:
    """Read and validate a lab configuration.

    Raises `visavis.lab.yaml_lines.ProblemsError` (a ConfigError) with everything that is wrong.
    """
    return _validate(read_document(path), option_models)


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
    return _validate(parse_document(text, path), option_models, folder)


def with_devices(config: LabConfig, kind: Literal["sim", "real"]) -> LabConfig:
    """Put every role on a simulated wire, or every role on its real one."""
    devices = {
        role: device.model_copy(update={"simulated": kind == "sim"})
        for role, device in config.devices.items()
    }
    return config.model_copy(update={"devices": devices})


def _validate(
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
    screen = _screen_of(raw)
    entries: dict[str, DeviceConfig] = {}
    if isinstance(devices, dict):
        for role, entry in devices.items():
            device = _device(document, role, entry, option_models, problems, screen)
            if device is not None:
                entries[device.role] = device
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
        gaze=file.gaze,
        devices=entries,
        wording={name: _absolute(folder, text) for name, text in file.wording.items()},
        studies={name: _absolute(folder, text) for name, text in file.studies.items()},
        cast=tuple(file.cast),
        characters=paths["data_root"] / CHARACTERS,
        language=file.language,
        incidents=file.incidents,
        path=document.path.absolute(),
        text=document.text,
        **paths,
    )


def _absolute(folder: Path, text: str) -> Path:
    return (folder / Path(text).expanduser()).resolve()


def _screen_of(raw: Mapping[str, Any]) -> Screen | None:
    """Return the screen in front of participants; mistakes in it are reported elsewhere."""
    try:
        return Display.model_validate(raw.get("display", {})).on_screen
    except ValidationError:
        return None


def is_own_role(role: str) -> bool:
    """Return whether the lab named the role itself; such a device is recorded with every study."""
    return role not in ROLES and not ARMBAND_ROLE.fullmatch(role)


def _device(
    document: Document,
    role: object,
    entry: object,
    option_models: OptionModels | None,
    problems: list[Problem],
    screen: Screen | None,
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
    is_simulated = entry.get("simulated", False)
    if not isinstance(is_simulated, bool):
        problems.append(document.problem((*at, "simulated"), f"is {is_simulated!r}; true or false"))
    driver = entry.get("driver")
    if not isinstance(driver, str):
        state = "is missing" if "driver" not in entry else f"is {driver!r}"
        near = did_you_mean("", option_models or ())
        problems.append(document.problem((*at, "driver"), f"{state}; name the driver{near}"))
        return None
    if option_models is not None and driver not in option_models:
        hint = did_you_mean(driver, option_models)
        problems.append(document.problem((*at, "driver"), f"unknown driver {driver!r}{hint}"))
        return None
    # Without the drivers' models only units in option names can be checked.
    if option_models is None:
        problems += [
            document.problem((*at, key), message)
            for key, value in options.items()
            if (message := _unit_doubt(key, value))
        ]
    else:
        model = option_models[driver]
        if screen is not None:
            problems += _take_screen_options(document, at, model, options, screen)
        option_problems = model_problems(
            document, model, options, at, also_known=("driver", "simulated")
        )
        problems += option_problems
        if not option_problems:
            # Defaults are filled in, so that the recording shows what the driver really used.
            options = {**options, **model.model_validate(options).model_dump()}
    return DeviceConfig(
        role=str(role), driver=driver, simulated=is_simulated is True, options=options
    )


def _take_screen_options(
    document: Document,
    at: KeyPath,
    model: type[BaseModel],
    options: dict[str, Any],
    screen: Screen,
) -> list[Problem]:
    """Give a screen-based eye tracker the lab's screen, so that it is described only once."""
    problems = []
    for name, value in screen.as_options().items():
        if name not in model.model_fields:
            continue
        if options.get(name, value) != value:
            problems.append(
                document.problem(
                    (*at, name),
                    f"is {options[name]}, but display.screen says {value:g}; leave it out here",
                )
            )
        options[name] = value
    return problems


def _unit_doubt(key: str, value: object) -> str | None:
    """Return a warning when the value of an undescribed option looks like another unit."""
    if unit_of(key) and isinstance(value, str):
        return explain_text(key, value)
    return explain_magnitude(key, value)
