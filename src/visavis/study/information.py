"""What participants are told is recorded, made from what is recorded.

Each fact is one line of the information for participants (`recorded.FACT` in the texts) and stands
for what recordings hold of it. What a page says about a browser is recorded only where a fact
covers it, so that nothing is recorded of which nobody was told.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from visavis.protocol.plan.questionnaires import Questionnaire
from visavis.stimuli.gaze_window import GAZE_WINDOW
from visavis.stimuli.room_areas import ROOM_SHAPE
from visavis.stimuli.view_turns import VIEW_TURNED
from visavis.study.experiment import StudyExperiment
from visavis.study.moulding import FIGURE_ON, FIGURE_TURNED, SLIDER_MOVED
from visavis.study.texts import Texts

ABOUT_PAGE: Final[Mapping[str, str]] = {
    "user_agent": "browser",
    "languages": "browser",
    "touch_points": "browser",
    "is_automated": "browser",
    "keeps_events": "browser",
    "checks_files": "browser",
    "tells_frames": "browser",
    "screen_px": "screen",
    "view_px": "screen",
    "pixel_ratio": "screen",
    "refresh_hz": "screen",
}
"""What a page says about its browser and screen, and the fact that covers it."""

PAGE_HAPPENINGS: Final = (
    "opened",
    "about",
    "visibility",
    "fullscreen",
    "resize",
    "problem",
    "rewound",
    "clock",
)
"""Kinds of page events that are no answers."""

EVENT_FACTS: Final[Mapping[str, tuple[str, ...]]] = {
    "page_served": (),
    "clock_exchanges": ("course",),
    "block_start": (),
    "block_end": (),
    "trial_start": (),
    "practice_again": (),
    "ended_early": (),
    "consent": ("agreement",),
    "full": ("agreement",),
    "stopped": ("agreement",),
    "answered": ("answers",),
    "answer": ("questionnaires",),
    "questionnaire_complete": ("questionnaires",),
    "films_drawn": (),
    "films_loaded": ("films",),
    "shown": ("flats",),
    "screen_measured": ("card",),
    "sound": ("sounds",),
    "sound_checked": ("voice",),
    "pointer_window": ("pointer",),
    VIEW_TURNED: ("turning",),
    "headset_entered": ("headset",),
    "discomfort": ("headset",),
    "wave": (),
}
"""Facts that cover the events of a session on a page. Plans of what is shown are about nobody."""

_COURSE: Final = ("course_in_lab",)
_CONTACT: Final = ("body", "vibrations")
LAB_EVENT_FACTS: Final[Mapping[str, tuple[str, ...]]] = {
    **dict.fromkeys(
        (
            "block_start",
            "block_end",
            "break_start",
            "break_end",
            "calibration",
            "calibration_below_threshold",
            "camera_on_head",
            "clock_exchanges",
            "device_back",
            "device_done_without",
            "device_lost",
            "drift_check",
            "end_validation_missed",
            "fault",
            "fault_over",
            "lab_recorder_start",
            "operator",
            "pause_start",
            "pause_end",
            "picture_stalled",
            "session_start",
            "session_end",
            "session_aborted",
            "session_failed",
            "training_end",
            "trial_start",
            "trial_repeat",
            "practice_again",
            "ended_early",
            "validation",
        ),
        _COURSE,
    ),
    **dict.fromkeys(
        (
            "board_on",
            "crowd",
            FIGURE_ON,
            "gaze_change",
            ROOM_SHAPE,
            "scene",
            "scene_on",
            "shown",
            "warp",
            "wave",
        ),
        ("shown",),
    ),
    **dict.fromkeys(("contact_begin", "contact_end", "contact_renew"), _CONTACT),
    "answer": ("questionnaires",),
    "questionnaire_complete": ("questionnaires",),
    "participant_memory": (),
    "own_body": ("stature",),
    "own_body_seen": ("stature",),
    "answered": ("answers_in_lab",),
    **dict.fromkeys((SLIDER_MOVED, FIGURE_TURNED), ("moulding_in_lab",)),
    VIEW_TURNED: ("turning",),
    "panel_answered": ("answers_in_lab",),
    "panel_shown": ("shown",),
    "sound": ("sounds",),
    "vibrated": ("vibrations",),
}
"""Facts that cover the events of a session in a laboratory."""

ROLE_FACTS: Final[Mapping[str, tuple[str, ...]]] = {
    "headset": ("head", "shown"),
    "eye_tracker": ("gaze",),
    "body_tracker": ("body",),
    "responses": ("presses",),
    "sound": ("sounds",),
}
"""Facts that cover what the device of a role measures."""

STREAM_FACTS: Final[Mapping[str, str]] = {
    "head": "head",
    "head_measured": "head",
    "gaze": "gaze",
    "openness": "gaze",
    "gaze_targets": "gaze",
    GAZE_WINDOW: "gaze",
    "body": "body",
    "hands": "hands",
    "responses": "presses",
    "pointer": "presses",
    "haptics": "vibrations",
    "band": "vibrations",
    "sound": "sounds",
    "frames": "shown",
    "frame_timing": "shown",
    "scene_states": "shown",
}
"""Facts that cover the streams of a session; another stream is a device's of the lab's own."""

ARMBAND: Final = "armband"


@dataclass(frozen=True)
class Information:
    """What participants are told is recorded: what comes first, one line a fact, what is not."""

    before: str
    lines: tuple[str, ...]
    after: str

    @property
    def as_text(self) -> str:
        """All of it, one line below the other."""
        return "\n".join([self.before, *(f"- {line}" for line in self.lines), self.after])


def information_on_page(
    experiment: StudyExperiment, questionnaires: Sequence[Questionnaire]
) -> Information:
    """Return what participants on a page are told is recorded."""
    screening = experiment.study.procedure.screening
    facts = ["agreement", "answers", "course"]
    facts += ["holding"] if experiment.settings.held_answers else []
    facts += ["films"] if experiment.films or experiment.videos else []
    facts += ["moulding"] if experiment.lives else []
    facts += ["flats"] if experiment.fills_screen else []
    facts += ["turning"] if experiment.panoramas else []
    facts += ["sounds"] if experiment.audibles else []
    streams = experiment.headset_streams
    facts += ["headset", *(STREAM_FACTS[name] for name in streams)] if streams else []
    facts += ["pointer"] if any("pointer" in t.rests_on for t in experiment.read.values()) else []
    facts += ["card"] if "card" in screening or experiment.fills_screen else []
    facts += ["distance"] if experiment.fills_screen else []
    facts += ["voice"] if "sound" in screening else []
    facts += ["questionnaires"] if questionnaires else []
    facts += ["browser", "screen", "panel"]
    return _information(experiment.texts, facts, questionnaires, "page")


def information_at_devices(
    experiment: StudyExperiment, questionnaires: Sequence[Questionnaire]
) -> Information:
    """Return what participants in a laboratory are told is recorded, from the devices in use."""
    roles = ("headset", *experiment.needed_roles, *experiment.useful_roles, "responses")
    facts = ["answers_in_lab", "course_in_lab", "stature"]
    facts += ["moulding_in_lab"] if experiment.lives else []
    facts += ["turning"] if experiment.panoramas else []
    others = []
    for role in dict.fromkeys(roles):
        if role.startswith(ARMBAND):
            facts.append("vibrations")
        elif role in ROLE_FACTS:
            facts += ROLE_FACTS[role]
        else:
            others.append(role)
    facts += ["questionnaires"] if questionnaires else []
    made = _information(experiment.texts, facts, questionnaires, "lab")
    lines = [experiment.texts.get("recorded.device", {"role": r}) for r in others]
    return Information(made.before, (*made.lines, *lines), made.after)


def facts_in_event(name: str, payload: Mapping[str, Any]) -> frozenset[str]:
    """Return the facts that cover an event of a session on a page.

    Raises:
        KeyError: no fact covers it, or something in it.
    """
    if name == "films_loaded" and not payload:  # a page without films says nothing of them
        return frozenset()
    if name != "page_event":
        measured = {"distance"} if "distance_by" in payload else set()
        return frozenset(EVENT_FACTS[name]) | measured
    kind = payload["kind"]
    about = payload.get("about") or {}
    facts = {ABOUT_PAGE[key] for key in about}
    if kind == "slept" or kind in PAGE_HAPPENINGS:
        return frozenset(facts | ({"course"} if kind != "about" else set()))
    if kind == "stream":
        return frozenset({STREAM_FACTS[payload["stream"]]})
    if kind == "xr":
        return frozenset({"headset"})
    if kind == "moved":
        return frozenset({"moulding"})
    if kind == "reply":
        reply = payload["reply"]
        facts |= {"agreement"} if "agreed" in reply or "stop" in reply else {"answers", "course"}
        facts |= {"headset"} if "entered" in reply else set()
        facts |= {"moulding"} if "renderer" in reply and "entered" not in reply else set()
        answers = [a for a in (reply.get("answers") or {}).values() if isinstance(a, Mapping)]
        facts |= {"holding"} if any("released_ms" in answer for answer in answers) else set()
        facts |= {"flats"} if "parts" in reply else set()
        facts |= {"sounds"} if any("sound" in p for p in reply.get("parts", ())) else set()
        facts |= {"pointer"} if any("pointer" in p for p in reply.get("parts", ())) else set()
        facts |= {"turning"} if any("turns" in p for p in reply.get("parts", ())) else set()
        facts |= {"card"} if "px_per_mm" in reply else set()
        facts |= {"distance"} if "distance_mm" in reply or "screen" in reply else set()
        return frozenset(facts)
    raise KeyError(kind)


def facts_in_lab_event(name: str) -> frozenset[str]:
    """Return the facts that cover an event of a session in a laboratory.

    Raises:
        KeyError: no fact covers it.
    """
    return frozenset(LAB_EVENT_FACTS[name])


def about_with_facts(about: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a page says about its browser, without what no fact covers."""
    return {name: value for name, value in about.items() if name in ABOUT_PAGE}


def _information(
    texts: Texts, facts: Iterable[str], questionnaires: Sequence[Questionnaire], place: str
) -> Information:
    values = {"titles": ", ".join(dict.fromkeys(q.title for q in questionnaires))}
    lines = tuple(texts.get(f"recorded.{fact}", values) for fact in dict.fromkeys(facts))
    return Information(
        texts.get(f"recorded.before_{place}"), lines, texts.get(f"recorded.after_{place}")
    )
