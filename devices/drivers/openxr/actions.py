"""The actions of an OpenXR session: directions of the eyes and both hands, and buttons.

Bindings are suggested first, everything is attached at once, and spaces come last. Runtimes require
this order, and a session takes action sets only once.
"""

import contextlib
import ctypes
import struct
from collections.abc import Iterable, Mapping
from typing import Any

GAZE_PROFILE = "/interaction_profiles/ext/eye_gaze_interaction"
GAZE_PATH = "/user/eyes_ext/input/gaze_ext/pose"
HANDS = ("left", "right")
BUTTONS = ("select", "menu", "grip")
HAND = struct.Struct("<?fQ7f")
"""Per hand, after the buttons: the trigger's axis is known, its value, flags and pose of its ray
(position, orientation x, y, z, w)."""
BUTTON_STATES = struct.Struct("<3b")
"""Per hand: each of `BUTTONS`; 1 down, 0 up, −1 there is no such button."""

_COMMON = {"aim": "input/aim/pose", "buzz": "output/haptic"}
PROFILES: Mapping[str, Mapping[str, str]] = {
    "khr/simple_controller": {
        **_COMMON,
        "select": "input/select/click",
        "menu": "input/menu/click",
    },
    "htc/vive_controller": {
        **_COMMON,
        "select": "input/trigger/click",
        "trigger": "input/trigger/value",
        "menu": "input/menu/click",
        "grip": "input/squeeze/click",
    },
    "valve/index_controller": {
        **_COMMON,
        "select": "input/trigger/click",
        "trigger": "input/trigger/value",
        "menu": "input/b/click",
        "grip": "input/squeeze/value",
    },
    "oculus/touch_controller": {
        **_COMMON,
        "select": "input/trigger/value",
        "trigger": "input/trigger/value",
        "grip": "input/squeeze/value",
    },
    "microsoft/motion_controller": {
        **_COMMON,
        "select": "input/trigger/value",
        "trigger": "input/trigger/value",
        "menu": "input/menu/click",
        "grip": "input/squeeze/click",
    },
}
"""Action -> path below a hand, by interaction profile, as the specification lists them."""

_WITH_SQUEEZE = {
    **_COMMON,
    "select": "input/trigger/value",
    "trigger": "input/trigger/value",
    "grip": "input/squeeze/value",
}
PROFILES_OF_EXTENSIONS: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "XR_META_touch_controller_plus": ("meta/touch_controller_plus", _WITH_SQUEEZE),
    "XR_FB_touch_controller_pro": ("facebook/touch_controller_pro", _WITH_SQUEEZE),
    "XR_BD_controller_interaction": ("bytedance/pico4_controller", _WITH_SQUEEZE),
    "XR_HTC_vive_focus3_controller_interaction": (
        "htc/vive_focus3_controller",
        {**_WITH_SQUEEZE, "grip": "input/squeeze/click"},
    ),
}
"""Profiles of newer controllers by the extension that has to be enabled for them: Touch Plus (Quest
3), Touch Pro, Pico 4, and Focus 3 with which a Vive XR Elite comes. Without theirs a runtime gives
such a controller through an older profile, or not at all."""


def controller_extensions(offered_extensions: Iterable[str]) -> list[str]:
    """Return the extensions of controllers that a runtime offers, to be enabled."""
    return [name for name in PROFILES_OF_EXTENSIONS if name in set(offered_extensions)]


class OpenXrActions:
    """The action set of one session: gaze where there is any, and two hands."""

    def __init__(
        self,
        xr: Any,
        instance: Any,
        session: Any,
        *,
        with_gaze: bool,
        extensions: Iterable[str] = (),
    ) -> None:
        self._xr = xr
        self._instance = instance
        self._session = session
        self._hand_paths = [self._path(f"/user/hand/{hand}") for hand in HANDS]
        self._set = xr.create_action_set(
            instance, xr.ActionSetCreateInfo(action_set_name="lab", localized_action_set_name="Lab")
        )
        kinds = xr.ActionType
        self._actions = {
            name: self._action(name, kind)
            for name, kind in (
                ("aim", kinds.POSE_INPUT),
                ("trigger", kinds.FLOAT_INPUT),
                ("buzz", kinds.VIBRATION_OUTPUT),
                *((button, kinds.BOOLEAN_INPUT) for button in BUTTONS),
            )
        }
        for profile, paths in PROFILES.items():
            self._suggest_hands(profile, paths)
        for extension in controller_extensions(extensions):
            # an older revision of an extension may lack a path: the other profiles still hold
            with contextlib.suppress(xr.exception.PathUnsupportedError):
                self._suggest_hands(*PROFILES_OF_EXTENSIONS[extension])
        if with_gaze:
            self._actions["gaze"] = self._action("gaze", kinds.POSE_INPUT, per_hand=False)
            self._suggest(GAZE_PROFILE, [(self._actions["gaze"], GAZE_PATH)])
        xr.attach_session_action_sets(
            session, xr.SessionActionSetsAttachInfo(action_sets=[self._set])
        )
        self.spaces = {
            f"aim {hand}": self._space("aim", path)
            for hand, path in zip(HANDS, self._hand_paths, strict=True)
        }
        if with_gaze:
            self.spaces["gaze"] = self._space("gaze")

    def sync(self) -> None:
        """Update the state of every action; without the focus there is none."""
        xr = self._xr
        xr.sync_actions(
            self._session, xr.ActionsSyncInfo(active_action_sets=[xr.ActiveActionSet(self._set, 0)])
        )

    def buttons(self, hand: int) -> tuple[int, ...]:
        """Return the state of `BUTTONS`: 1 down, 0 up, −1 not there."""
        xr, states = self._xr, []
        for name in BUTTONS:
            state = xr.get_action_state_boolean(self._session, self._get_info(name, hand))
            states.append(int(bool(state.current_state)) if state.is_active else -1)
        return tuple(states)

    def trigger(self, hand: int) -> float | None:
        """Return how far the trigger is pulled, 0 to 1; None where nothing measures that."""
        state = self._xr.get_action_state_float(self._session, self._get_info("trigger", hand))
        return float(state.current_state) if state.is_active else None

    def buzz(self, hand: int, duration_us: int) -> None:
        """Let a controller vibrate at its usual frequency."""
        xr = self._xr
        vibration = xr.HapticVibration(duration=duration_us * 1000, frequency=0.0, amplitude=1.0)
        info = xr.HapticActionInfo(
            action=self._actions["buzz"], subaction_path=self._hand_paths[hand]
        )
        header = ctypes.cast(ctypes.pointer(vibration), ctypes.POINTER(xr.HapticBaseHeader))
        xr.apply_haptic_feedback(self._session, info, header.contents)

    # ---- private --------------------------------------------------------------------------

    def _path(self, text: str) -> Any:
        return self._xr.string_to_path(self._instance, text)

    def _action(self, name: str, kind: Any, *, per_hand: bool = True) -> Any:
        return self._xr.create_action(
            self._set,
            self._xr.ActionCreateInfo(
                action_type=kind,
                action_name=name,
                localized_action_name=name.capitalize(),
                subaction_paths=self._hand_paths if per_hand else [],
            ),
        )

    def _suggest_hands(self, profile: str, paths: Mapping[str, str]) -> None:
        bindings = [
            (self._actions[name], f"/user/hand/{hand}/{path}")
            for hand in HANDS
            for name, path in paths.items()
        ]
        self._suggest(f"/interaction_profiles/{profile}", bindings)

    def _suggest(self, profile: str, bindings: list[tuple[Any, str]]) -> None:
        xr = self._xr
        suggestions = [xr.ActionSuggestedBinding(a, self._path(path)) for a, path in bindings]
        xr.suggest_interaction_profile_bindings(
            self._instance,
            xr.InteractionProfileSuggestedBinding(
                interaction_profile=self._path(profile), suggested_bindings=suggestions
            ),
        )

    def _space(self, name: str, hand: Any = 0) -> Any:
        xr = self._xr
        info = xr.ActionSpaceCreateInfo(action=self._actions[name], subaction_path=hand)
        return xr.create_action_space(self._session, info)

    def _get_info(self, name: str, hand: int) -> Any:
        return self._xr.ActionStateGetInfo(
            action=self._actions[name], subaction_path=self._hand_paths[hand]
        )


def supports_gaze(xr: Any, instance: Any, system: Any) -> bool:
    """Tell whether the headset of a system tracks the eyes."""
    gaze = xr.SystemEyeGazeInteractionPropertiesEXT()
    properties = xr.SystemProperties(next=ctypes.cast(ctypes.pointer(gaze), ctypes.c_void_p))
    result = xr.raw_functions.xrGetSystemProperties(instance, system, ctypes.byref(properties))
    xr.check_result(xr.Result(result))
    return bool(gaze.supports_eye_gaze_interaction)
