"""Stages that draw a session's scenes: on a monitor, in a window, in the headset, or off screen."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import cast

from visavis.devices.contracts import BodyTracker, KeyListener, LatePose, OnScreen
from visavis.devices.screen.display import ScreenDisplay
from visavis.lab.clock import Clock
from visavis.lab.config import LabConfig, Screen
from visavis.lab.errors import ConfigError
from visavis.lab.frame import EyeView
from visavis.lab.geometry import Pose, quat_conjugate, rotate
from visavis.protocol.plan.experiment import Experiment
from visavis.protocol.session.rig import Rig
from visavis.running.sessions.device_setup import is_simulated
from visavis.stage.card.context import draws_on_processor, offscreen_context
from visavis.stage.contracts import Stage, Viewer
from visavis.stage.drawn_stage import Display, DrawnStage, default_views
from visavis.stage.fades import FadeTimes
from visavis.stage.mirror import Mirror
from visavis.stage.own_body import OwnBody
from visavis.stage.renderer import ON_PROCESSOR, Quality, Renderer
from visavis.stage.screen_surface import ScreenSurface
from visavis.stage.window import Window
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.dressing.picture_of import picture_of

OFFSCREEN_PX = (480, 540)
USUAL_EYE_PX = (1440, 1600)
EXTRA_PEOPLE = 1
"""People a picture may hold beside the study's own: the participant's body."""

Views = Callable[[], Sequence[EyeView]]


def build_drawn_stage(
    config: LabConfig,
    experiment: Experiment,
    rig: Rig,
    clock: Clock,
    viewers: Sequence[Viewer],
) -> Stage:
    """Build the stage `display.show` asks for.

    Raises:
        ConfigError: the headset cannot show pictures.
        StageError: there is no screen, or nothing that draws on it.
    """
    show, asks = config.display.show, config.display.questions != "terminal"
    n, rate_hz = experiment.people_count + EXTRA_PEOPLE, rig.headset.display_rate_hz
    fades = FadeTimes(config.display.fade_out_ms, config.display.fade_in_ms)
    if show == "offscreen":
        # An OpenXR session is opened in the context that will draw, so that comes first.
        context = offscreen_context() if _show_images(rig) else None
        return DrawnStage(
            picture_of,
            lambda: Renderer(context, quality=quality_of(config, on_processor=True)),
            _through_screen(rig, n)
            or Display(
                getattr(rig.headset, "eye_views", default_views),
                lambda: OFFSCREEN_PX,
                n,
                rate_hz,
                views_from=_followed_views(rig),
                late_head=_late_head(rig),
            ),
            clock,
            viewers=viewers,
            asks=asks,
            own_body=_own_body(config, rig),
            fades=fades,
        )
    if show == "screen":
        return _on_screen(config, experiment, rig, clock, viewers)
    # The window shows the picture itself, or mirrors what the headset shows.
    window_px = (config.display.window_width_px, config.display.window_height_px)
    if show == "window":
        display = Display(_one_eye(window_px), lambda: window_px, n, rate_hz, hands_over=False)
    else:
        display = _of_headset(config, rig, n)
        _show_images(rig)
    window = Window(window_title(config, experiment), window_px)
    if show == "window":
        _hear(window, rig)
    quality = quality_of(config, on_processor=draws_on_processor(window.context))
    return DrawnStage(
        picture_of,
        lambda: Renderer(window.context, quality=quality),
        display,
        clock,
        viewers=viewers,
        mirror=Mirror(window),
        asks=asks,
        own_body=_own_body(config, rig),
        fades=fades,
    )


def quality_of(config: LabConfig, *, on_processor: bool) -> Quality:
    """Return how pictures are drawn: as suits the computer, except for the lab's own settings."""
    usual, settings = ON_PROCESSOR if on_processor else Quality(), config.display.quality
    detail = usual.detail
    if settings.full_detail_px is not None:
        finest, *coarser = detail.faces_px
        share = settings.full_detail_px / finest
        detail = replace(detail, faces_px=(finest * share, *(px * share for px in coarser)))
    shadows = settings.shadows or usual.shadows
    return replace(
        usual,
        samples=usual.samples if settings.samples is None else settings.samples,
        shadows="blobs" if on_processor and shadows in ("maps", "area") else shadows,
        shadow_map_px=settings.shadow_map_px or usual.shadow_map_px,
        detail=detail,
    )


def _on_screen(
    config: LabConfig,
    experiment: Experiment,
    rig: Rig,
    clock: Clock,
    viewers: Sequence[Viewer],
) -> Stage:
    """Open the participant's window on their monitor, and let the session keep its pace."""
    screen, display = config.display.on_screen, rig.headset
    picture = _through_screen(rig, experiment.people_count + EXTRA_PEOPLE)
    if screen is None or picture is None or not isinstance(display, ScreenDisplay):
        raise ConfigError(f"{config.path}: display.show is screen, but no screen is described")
    window = open_on_monitor(screen, display, clock, window_title(config, experiment))
    _hear(window, rig)
    quality = quality_of(config, on_processor=draws_on_processor(window.context))
    return DrawnStage(
        picture_of,
        lambda: Renderer(window.context, quality=quality),
        picture,
        clock,
        viewers=viewers,
        window=window,
        asks=config.display.questions != "terminal",
        own_body=_own_body(config, rig),
        fades=FadeTimes(config.display.fade_out_ms, config.display.fade_in_ms),
    )


def open_on_monitor(screen: Screen, display: ScreenDisplay, clock: Clock, title: str) -> Window:
    """Open the participant's window on their monitor and let the display keep the monitor's pace.

    Raises:
        StageError: there is no such monitor, it has other pixels, or nothing draws on it.
    """
    window = Window(
        title,
        (screen.width_px, screen.height_px),
        monitor=screen.monitor if screen.fullscreen else None,
    )
    display.attach(ScreenSurface(window, clock))
    return window


def _hear(window: Window, rig: Rig) -> None:
    """Let keyboards hear the keys of the window that people sit before."""
    for device in rig.by_role().values():
        if isinstance(device, KeyListener):
            window.hear_keys(device.hear)


def _through_screen(rig: Rig, people_count: int) -> Display | None:
    """Return what is drawn for a screen: one picture, seen through it from where the eyes are."""
    display = rig.headset
    if not isinstance(display, OnScreen):
        return None
    screen, place = display.screen, display.place

    def from_head(head: Pose) -> tuple[EyeView]:
        turn = quat_conjugate(place.orientation_wxyz)
        return (screen.view_from(rotate(turn, head.position_m - place.position_m)),)

    return Display(
        lambda: from_head(place),
        lambda: (screen.width_px, screen.height_px),
        people_count,
        display.display_rate_hz,
        views_from=from_head,
    )


def window_title(config: LabConfig, experiment: Experiment) -> str:
    """Return the title of a session's window; a rehearsal's says that it is one."""
    mark = "  ·  SIMULATED, not a participant" if is_simulated(config) else ""
    return f"Visavis: {experiment.name}{mark}"


def _show_images(rig: Rig) -> bool:
    """Announce images to a headset that must know in advance; return whether it is one."""
    prepare = getattr(rig.headset, "show_images", None)
    if prepare is not None:
        prepare()
    return prepare is not None


def _own_body(config: LabConfig, rig: Rig) -> OwnBody | None:
    """Return the body participants see as their own; None without a tracker, or if not wanted."""
    tracker = rig.others.get("body_tracker")
    gender = config.display.own_body
    if gender == "none" or not isinstance(tracker, BodyTracker):
        return None
    return OwnBody(default_casting(f"{gender}_01"), tracker.segments)


def _one_eye(size_px: tuple[int, int]) -> Views:
    """Return one camera between the eyes that fills a window, 70° high."""
    top = 0.7
    wide = top * size_px[0] / size_px[1]
    eye = EyeView((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), -wide, wide, -top, top)
    return lambda: (eye,)


def _of_headset(config: LabConfig, rig: Rig, people_count: int) -> Display:
    headset = rig.headset
    if not hasattr(headset, "eye_views"):
        raise ConfigError(
            f"{config.path}: display.show is headset, but {headset.info.driver} shows no pictures; "
            "name a headset that does (openvr_headset, openxr_headset), or choose window or none"
        )
    views = cast(Views, headset.eye_views)

    def size_px() -> tuple[int, int]:
        width, height = getattr(headset, "render_size_px", USUAL_EYE_PX)
        scale = config.display.quality.render_scale
        return round(scale * width), round(scale * height)

    return Display(
        views,
        size_px,
        people_count,
        headset.display_rate_hz,
        views_from=_followed_views(rig),
        late_head=_late_head(rig),
    )


def _followed_views(rig: Rig) -> Callable[[Pose], Sequence[EyeView]] | None:
    """Return how a headset's views are asked in every frame; None where there are none.

    Somebody may turn the knob that moves the eyes apart.
    """
    views: Views | None = getattr(rig.headset, "eye_views", None)
    return None if views is None else lambda _: views()


def _late_head(rig: Rig) -> Callable[[], Pose | None] | None:
    """Return how the headset is asked for its head again; None where it cannot be."""
    return rig.headset.late_head if isinstance(rig.headset, LatePose) else None
