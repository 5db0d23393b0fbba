"""The error tree; every message says what happened, to which thing, and what to do next."""


class LabError(Exception):
    """Base of every error Visavis raises on purpose.

    `exit_code` is what the command line returns.
    """

    exit_code = 1


class ConfigError(LabError):
    """A configuration, questionnaire or study file is wrong; lists all problems at once."""

    exit_code = 2


class UsageError(LabError):
    """The command cannot do what was asked; the message says what to do instead."""

    exit_code = 2


class DesignError(LabError):
    """A design cannot be built: impossible balance, unknown factor, duplicate level."""

    exit_code = 2


class SessionAborted(LabError):
    """The session ended early and can be resumed."""

    exit_code = 3


class DeviceError(LabError):
    """A device failed. `role` names it as the operator does, `remedy` is what to do now."""

    exit_code = 4

    def __init__(self, message: str, *, role: str = "", remedy: str = "") -> None:
        parts = [f"{role}: {message}" if role else message]
        if remedy:
            parts.append(remedy)
        super().__init__("; ".join(parts))
        self.role = role
        self.remedy = remedy


class DeviceNotFound(DeviceError):
    """The device, its runtime or its library is not there."""


class DeviceDisconnected(DeviceError):
    """The device was there and went away."""


class DeviceTimeout(DeviceError, TimeoutError):
    """The device accepted but did not answer in time."""


class ProtocolViolation(DeviceError):
    """The device answered something its protocol does not allow."""


class DataError(LabError):
    """Recorded or imported data are wrong; the message names file and row."""

    exit_code = 5


class RecordingError(DataError):
    """A recording cannot be written or read."""


class LedgerError(LabError):
    """The participant ledger refuses: unknown, duplicate, mistyped or withdrawn identifier."""

    exit_code = 2
