"""The stopped parts of Pupil Capture, from its notifications, in words for the operator."""

from dataclasses import dataclass, field

STOP_TEXTS = {
    "eye_process.stopped": "the eye camera's process stopped",
    "world_process.stopped": "Pupil Capture's main process stopped",
    "service_process.stopped": "Pupil Service stopped",
    "launcher_process.should_stop": "Pupil Capture is closing",
    "stop_plugin": "a plug-in of Pupil Capture stopped",
}
STARTED_AGAIN = {"eye_process.started": "eye_process.stopped"}
EYE_NAMES = {0: "right", 1: "left"}


@dataclass
class StoppedParts:
    """Parts that stopped since start and have not started again, by part and eye."""

    stop_texts: dict[str, str] = field(default_factory=dict)

    def note(self, subject: str, eye_id: object = None) -> None:
        """Remember a notification about a part that stopped, or started again."""
        eye = EYE_NAMES.get(eye_id, "") if isinstance(eye_id, int) else ""
        if subject in STOP_TEXTS:
            self.stop_texts[f"{subject} {eye}"] = (
                f"{STOP_TEXTS[subject]}{f' ({eye})' if eye else ''}"
            )
        elif subject in STARTED_AGAIN:
            self.stop_texts.pop(f"{STARTED_AGAIN[subject]} {eye}", None)
