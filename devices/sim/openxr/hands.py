"""The controllers of a simulated OpenXR runtime: actions by name, bindings, two tracked hands.

A body's presses become buttons ("trigger", "left_grip"); a pulled trigger is all the way down.
Paths are checked against the profiles of the specification (section 6.4). Not modelled: touch
sensors, thumbsticks, dead zones, which controller a hand holds (always one with everything).
"""

# ruff: noqa: N802 - the functions bear the names of OpenXR

import ctypes
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from visavis.devices.contracts import Body, MovingBody
from visavis.lab.geometry import rotate

SUCCESS, SESSION_NOT_FOCUSED = 0, 8
PATH_UNSUPPORTED, PATH_FORMAT_INVALID, ACTION_TYPE_MISMATCH = -22, -21, -27
NAME_DUPLICATED, ACTIONSET_NOT_ATTACHED, ACTIONSETS_ALREADY_ATTACHED = -44, -46, -47
WELL_FORMED_PATH = re.compile(r"(/(?!\.+(/|$))[a-z0-9\-_.]+)+")
"""Section 6.2 of the specification: levels of lower-case characters, none of dots alone."""
WELL_FORMED_NAME = re.compile(r"[a-z0-9\-_.]{1,63}")
BOOLEAN, FLOAT = 1, 2
SEGMENTS = ("left_hand", "right_hand")
OFFSETS_M = ((-0.25, -0.45, -0.3), (0.25, -0.45, -0.3))
PRESSES = {"trigger": "select", "select": "select", "menu": "menu", "grip": "grip"}
_ALWAYS = ("input/aim/pose", "output/haptic")
VALID_PATHS = {
    "/interaction_profiles/khr/simple_controller": ("input/select/click", "input/menu/click"),
    "/interaction_profiles/htc/vive_controller": (
        "input/trigger/click",
        "input/trigger/value",
        "input/menu/click",
        "input/squeeze/click",
    ),
    "/interaction_profiles/valve/index_controller": (
        "input/trigger/click",
        "input/trigger/value",
        "input/a/click",
        "input/b/click",
        "input/squeeze/value",
    ),
    "/interaction_profiles/oculus/touch_controller": (
        "input/trigger/value",
        "input/squeeze/value",
    ),
    "/interaction_profiles/microsoft/motion_controller": (
        "input/trigger/value",
        "input/menu/click",
        "input/squeeze/click",
    ),
    "/interaction_profiles/ext/eye_gaze_interaction": ("/user/eyes_ext/input/gaze_ext/pose",),
    "/interaction_profiles/meta/touch_controller_plus": (
        "input/trigger/value",
        "input/squeeze/value",
    ),
    "/interaction_profiles/facebook/touch_controller_pro": (
        "input/trigger/value",
        "input/squeeze/value",
    ),
    "/interaction_profiles/bytedance/pico4_controller": (
        "input/trigger/click",
        "input/trigger/value",
        "input/squeeze/click",
        "input/squeeze/value",
    ),
    "/interaction_profiles/htc/vive_focus3_controller": (
        "input/trigger/click",
        "input/trigger/value",
        "input/squeeze/click",
    ),
}
NEEDS_EXTENSION = {
    "/interaction_profiles/meta/touch_controller_plus": "XR_META_touch_controller_plus",
    "/interaction_profiles/facebook/touch_controller_pro": "XR_FB_touch_controller_pro",
    "/interaction_profiles/bytedance/pico4_controller": "XR_BD_controller_interaction",
    "/interaction_profiles/htc/vive_focus3_controller": "XR_HTC_vive_focus3_controller_interaction",
}
"""Profiles that a runtime knows only with this extension; Khronos' registry, version 1.1."""


class SimulatedHands:
    """The functions of a runtime that concern actions; `off` names the hands without one."""

    def __init__(
        self, body: Body, now_ns: Callable[[], int], has_focus: Callable[[], bool]
    ) -> None:
        self.off: set[int] = set()
        self.extensions: list[str] = list(NEEDS_EXTENSION.values())
        self.profiles: list[str] = []
        self.pulses: list[tuple[int, int]] = []
        self.is_attached = False
        self._body = body
        self._now_ns = now_ns
        self._has_focus = has_focus
        self._names: dict[int, str] = {}
        self._kinds: dict[str, int] = {}
        self._paths: dict[int, str] = {}
        self._down: set[tuple[int, str]] = set()
        self._new_handle: Callable[[Any], int] = lambda _: 0

    def allocate_with(self, new_handle: Callable[[Any], int]) -> None:
        """Take handles from the runtime."""
        self._new_handle = new_handle

    def forget(self) -> None:
        """Forget actions and their attachment, as at the end of an instance."""
        self.is_attached = False
        self._names.clear()
        self._kinds.clear()
        self._down.clear()

    def hand_of(self, space_info: Any) -> int | None:
        """Return the hand of an action space; None: it belongs to the eyes."""
        path = self._paths.get(int(space_info.subaction_path), "")
        return None if not path else int(path.endswith("right"))

    def pose(self, hand: int, t_ns: int) -> tuple[list[float], list[float]] | None:
        """Return the pose of a hand: position and orientation (w, x, y, z), None without one."""
        if hand in self.off:
            return None
        if isinstance(self._body, MovingBody):
            places, turns = self._body.segments((SEGMENTS[hand],), np.array((t_ns,), np.int64))
            return places[0, 0].tolist(), turns[0, 0].tolist()
        place, turn = self._body.head(t_ns)
        return (place + rotate(turn, np.array(OFFSETS_M[hand]))).tolist(), turn.tolist()

    # ---- the runtime's functions -------------------------------------------------------------

    def _xr_StringToPath(self, instance: Any, text: Any, path: Any) -> int:
        path_text = text.decode() if isinstance(text, bytes) else str(text)
        if WELL_FORMED_PATH.fullmatch(path_text) is None:
            return PATH_FORMAT_INVALID
        numbers_by_path = {name: number for number, name in self._paths.items()}
        number = numbers_by_path.get(path_text, len(self._paths) + 1)
        self._paths[number] = path_text
        ctypes.cast(path, ctypes.POINTER(ctypes.c_uint64))[0] = number
        return SUCCESS

    def _xr_CreateActionSet(self, instance: Any, info: Any, actions: Any) -> int:
        self._new_handle(actions)
        return SUCCESS

    def _xr_CreateAction(self, actions: Any, info: Any, action: Any) -> int:
        raw_name, kind = info.contents.action_name, info.contents.action_type
        name = raw_name.decode() if isinstance(raw_name, bytes) else str(raw_name)
        if WELL_FORMED_NAME.fullmatch(name) is None:
            return PATH_FORMAT_INVALID
        if self.is_attached:
            return ACTIONSETS_ALREADY_ATTACHED
        if name in self._names.values():
            return NAME_DUPLICATED
        handle = self._new_handle(action)
        self._names[handle], self._kinds[name] = name, int(getattr(kind, "value", kind))
        return SUCCESS

    def _xr_SuggestInteractionProfileBindings(self, instance: Any, bindings: Any) -> int:
        if self.is_attached:
            return ACTIONSETS_ALREADY_ATTACHED
        suggestion = bindings.contents
        profile = self._paths[int(suggestion.interaction_profile)]
        if profile not in VALID_PATHS:
            return PATH_UNSUPPORTED
        if NEEDS_EXTENSION.get(profile) not in (None, *self.extensions):
            return PATH_UNSUPPORTED
        self.profiles.append(profile.removeprefix("/interaction_profiles/"))
        for i in range(suggestion.count_suggested_bindings):
            path = self._paths[int(suggestion._suggested_bindings[i].binding)]  # noqa: SLF001 - the package's field
            below = path.removeprefix("/user/hand/left/").removeprefix("/user/hand/right/")
            if below not in (*VALID_PATHS[profile], *_ALWAYS):
                return PATH_UNSUPPORTED
        return SUCCESS

    def _xr_AttachSessionActionSets(self, session: Any, info: Any) -> int:
        if self.is_attached:
            return ACTIONSETS_ALREADY_ATTACHED
        self.is_attached = True
        return SUCCESS

    def _xr_SyncActions(self, session: Any, info: Any) -> int:
        if not self.is_attached:
            return ACTIONSET_NOT_ATTACHED
        for _, control, value in self._body.presses(self._now_ns()):
            side, _, button = control.rpartition("_")
            key = (int(side != "left"), PRESSES[button])
            (self._down.add if value > 0.5 else self._down.discard)(key)
        return SUCCESS if self._has_focus() else SESSION_NOT_FOCUSED

    def _xr_GetActionStateBoolean(self, session: Any, info: Any, state: Any) -> int:
        hand, name = self._hand_and_name(info.contents)
        if (problem := self._refusal(name, BOOLEAN)) != SUCCESS:
            return problem
        state.contents.is_active = self._is_on(hand)
        state.contents.current_state = (hand, name) in self._down and self._is_on(hand)
        return SUCCESS

    def _xr_GetActionStateFloat(self, session: Any, info: Any, state: Any) -> int:
        hand, name = self._hand_and_name(info.contents)
        if (problem := self._refusal(name, FLOAT)) != SUCCESS:
            return problem
        state.contents.is_active = self._is_on(hand)
        is_pulled = (hand, "select") in self._down and self._is_on(hand)
        state.contents.current_state = float(is_pulled)
        return SUCCESS

    def _xr_ApplyHapticFeedback(self, session: Any, info: Any, vibration: Any) -> int:
        import xr

        pulse = ctypes.cast(vibration, ctypes.POINTER(xr.HapticVibration)).contents
        path = self._paths[int(info.contents.subaction_path)]
        self.pulses.append((int(path.endswith("right")), int(pulse.duration) // 1000))
        return SUCCESS

    # ---- inside -----------------------------------------------------------------------------

    def _refusal(self, name: str, kind: int) -> int:
        if not self.is_attached:
            return ACTIONSET_NOT_ATTACHED
        return SUCCESS if self._kinds[name] == kind else ACTION_TYPE_MISMATCH

    def _hand_and_name(self, info: Any) -> tuple[int, str]:
        handle = int(ctypes.cast(info.action, ctypes.c_void_p).value or 0)
        hand = int(self._paths[int(info.subaction_path)].endswith("right"))
        return hand, self._names[handle]

    def _is_on(self, hand: int) -> bool:
        return hand not in self.off and self._has_focus()
