"""Draw a frame of a recording again, from the recording alone."""

import bisect
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.config import Screen
from visavis.lab.errors import DataError, UsageError
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import Pose
from visavis.lab.screen import PlacedScreen
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.shown_scene import RecordedScene, of_part, recorded_scene
from visavis.recording.cached import CachedRecording
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy, overrides_of
from visavis.stage.drawn_stage import Display, DrawnStage, default_views
from visavis.stage.frame_truth import read_views
from visavis.stage.own_body import OwnBody
from visavis.stage.renderer import Image, Renderer
from visavis.stage.stills import STILL, shrink
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.panels import IN_HEADSET, SIZE_M, PanelFrame, Surface, board_pose
from visavis.stimuli.picture import Panel
from visavis.stimuli.scene import SceneFrame
from visavis.study.experiment import StudyExperiment
from visavis.study.responses import Keys
from visavis.study.trial import TrialScript
from visavis.study.trial_settings import is_on_board

UNDRAWN_PX: Final = (720, 800)
MARKED_NS: Final = NS_PER_S // 2
"""A film marks an answer this long before it was given, so that the mark can be seen."""
FIRST_SAMPLES, LAST_SAMPLES = 3, 3
"""How many samples of a tracker may have been the first that was taken, and the last."""


@dataclass(frozen=True, eq=False)
class RecordedFrame:
    """A drawn frame as recorded: what it may have shown (the row's checksum tells which), what was
    lit last if its light was still going, its row of the stream `drawn` and that of `drawn_views`,
    and what the participant may have seen as their own body.
    """

    views_shown: tuple[SceneFrame, ...]
    views_lit: tuple[SceneFrame, ...]
    drawn_row: np.void
    views: np.void
    bodies: tuple[OwnBody, ...] = ()


def recorded_frame(
    study: OpenedStudy, recording: Recording, frame: int, *, part: int | None = None
) -> RecordedFrame:
    """Return everything a re-draw of a frame needs; `part` of the session is the first by default.

    Raises:
        UsageError: nothing was drawn in this frame.
    """
    if not was_drawn(recording):
        raise UsageError(
            f"{recording.path}: nothing was drawn in this session (display.show was none); see "
            f"its trials again with visavis view {recording.path}, or film one: visavis film"
        )
    part_number = recording.manifest.parts[0].number if part is None else part
    drawn_rows = of_part(recording, "drawn", part_number)
    at = np.flatnonzero(drawn_rows["frame"] == frame)
    if not len(at) or not drawn_rows["drawn"][at[0]]:
        numbers = drawn_rows["frame"][drawn_rows["drawn"]]
        span = f"{numbers[0]} to {numbers[-1]}" if len(numbers) else "none"
        raise UsageError(f"frame {frame} was not drawn in part {part_number}; drawn: {span}")
    row = _row(recording, "drawn", drawn_rows, int(at[0]))
    views = of_part(recording, "drawn_views", part_number)
    latest = int(np.flatnonzero(views["t_host_ns"] <= drawn_rows["t_host_ns"][at[0]])[-1])

    def shown_in_row(i: int) -> RecordedScene:
        place, t_scene_ns = drawn_rows["head_position_m"][i], int(drawn_rows["t_scene_ns"][i])
        return recorded_scene(
            recording, part_number, int(drawn_rows["frame"][i]), t_scene_ns, place
        )

    here = shown_in_row(int(at[0]))
    drawn_ns = int(drawn_rows["t_host_ns"][at[0]])
    bare = tuple(study.views_of(here))
    boards = boards_at(recording, study, part_number, here.t_ns)
    is_fading = here.scene.brightness_01 <= 0.0 < drawn_rows["brightness_01"][at[0]]
    before = _last_lit(drawn_rows["brightness_01"], int(at[0]), shown_in_row) if is_fading else None
    return RecordedFrame(
        (*bare, *(with_board(view, board) for board in boards for view in bare)),
        () if before is None else tuple(study.views_of(before)),
        row,
        _row(recording, "drawn_views", views, latest),
        _bodies(recording, part_number, drawn_ns),
    )


def _last_lit(
    brightness_01: npt.NDArray[np.float32], at: int, shown_in_row: Callable[[int], RecordedScene]
) -> RecordedScene | None:
    """Return what was shown in the last lit frame before one whose light is going."""
    first = at
    while first > 0 and brightness_01[first - 1] >= brightness_01[first]:
        first -= 1
    rows = range(first, at)
    dark = bisect.bisect_left(rows, True, key=lambda i: shown_in_row(i).scene.brightness_01 <= 0.0)
    return shown_in_row(rows[dark - 1]) if dark else None


def redraw(
    study: OpenedStudy, recording: Recording, frame: int, *, part: int | None = None
) -> list[Image]:
    """Draw a recorded frame of a study again; return its images, left first, equal within rounding.

    Where nothing was drawn in the session, it is drawn as it would have been, by two eyes that see
    90° up and down.

    Raises:
        UsageError: see `recorded_frame`.
        StageError: nothing can draw here, or this version dresses the scene in another way.
    """
    if not was_drawn(recording):
        return _draw_anew(study, recording, frame, part)
    record = recorded_frame(study, recording, frame, part=part)
    views, size_px, quality = read_views(record.views)
    people = len(record.drawn_row["level"])
    stage = DrawnStage(
        picture_of,
        lambda: Renderer(quality=quality),
        Display(lambda: views, lambda: size_px, people),
        SimClock(),
    )
    try:
        return stage.redraw(record.views_shown, record.drawn_row, record.views_lit, record.bodies)
    finally:
        stage.close()


def was_drawn(recording: Recording) -> bool:
    """Tell whether anything was drawn in a session."""
    return "drawn" in recording.stream_names


def _draw_anew(
    study: OpenedStudy, recording: Recording, frame: int, part: int | None
) -> list[Image]:
    """Draw a frame of a session in which nothing was drawn."""
    part_number = recording.manifest.parts[0].number if part is None else part
    if "frames" not in recording.stream_names:
        raise UsageError(f"{recording.path} has no frames; `visavis film` films its pages")
    frames = of_part(recording, "frames", part_number)
    at = np.flatnonzero(frames["frame_index"] == frame)
    if not len(at):
        numbers = frames["frame_index"]
        span = f"{numbers[0]} to {numbers[-1]}" if len(numbers) else "none"
        raise UsageError(f"part {part_number} has no frame {frame}; it has {span}")
    t_ns = int(frames["t_host_ns"][at[0]])
    head = _head_at(recording, part_number, t_ns)
    moment = recorded_scene(recording, part_number, frame, t_ns, head.position_m)
    view = next(iter(study.views_of(moment)))
    board = next(iter(boards_at(recording, study, part_number, t_ns)), None)
    if board is not None:
        view = with_board(view, board)
    times, (width, height) = STILL.shrink_factor, UNDRAWN_PX
    stage = DrawnStage(
        picture_of,
        lambda: Renderer(quality=STILL),
        Display(default_views, lambda: (times * width, times * height), 0),
        SimClock(),
    )
    try:
        stage.draw(view, FrameInfo(frame, t_ns, t_ns), head)
        if (trouble := stage.trouble()) is not None:
            raise trouble
        return [shrink(image, UNDRAWN_PX) for image in stage.images()]
    finally:
        stage.close()


# ---- what stands in a frame besides its scene -------------------------------------------------


def boards_at(recording: Recording, study: OpenedStudy, part: int, t_ns: int) -> Iterator[Panel]:
    """Yield the boards that may have stood before the participant, each choice lit in turn."""
    for panel in (
        *_questionnaire_board(recording, part, t_ns),
        *_trial_boards(recording, study, part, t_ns),
    ):
        for highlight in (None, *range(len(panel.choices))):
            yield replace(panel, highlighted=highlight)


def board_at(recording: Recording, study: OpenedStudy, part: int, t_ns: int) -> Panel | None:
    """Return the board that stood before the participant; for a moment before a trial's question
    was answered the answer is marked.
    """
    board = next(boards_at(recording, study, part, t_ns), None)
    answer = None if board is None else _answer_soon(recording, study, part, t_ns)
    return board if board is None or answer is None else replace(board, chosen=answer)


def with_board(view: SceneFrame, board: Panel) -> PanelFrame:
    """Return a view with a board in it."""
    return PanelFrame(
        view.scene,
        view.t_ns,
        view.gaze_direction,
        view.eye_openness_01,
        view.people,
        view.gaze_distance_m,
        view.turned_deg,
        view.window_at,
        panels=(board,),
    )


def _questionnaire_board(recording: Recording, part: int, t_ns: int) -> Iterator[Panel]:
    """Yield the board of a questionnaire that had been shown and not yet answered."""
    board_events, answer_events = (
        recording.events_named(name, part) for name in ("panel_shown", "panel_answered")
    )
    before = board_events[board_events["t_ns"] <= t_ns]
    if not len(before):
        return
    begun_ns, payload = int(before.iloc[-1]["t_ns"]), before.iloc[-1]["payload"]
    later_answers = answer_events[
        (answer_events["t_ns"] >= begun_ns) & (answer_events["t_ns"] < t_ns)
    ]
    if len(later_answers) or "position_m" not in payload:
        return
    pose = Pose(np.array(payload["position_m"]), np.array(payload["orientation_wxyz"]))
    yield Panel(
        payload["prompt"],
        tuple(payload["choices"]),
        pose,
        tuple(payload.get("size_m", SIZE_M)),
        rows=payload.get("rows", 1),
        keys=tuple(payload.get("keys", ())),
        ends=tuple(payload.get("ends", ("", ""))),
        hint=payload.get("hint", ""),
    )


def _trial_boards(
    recording: Recording, study: OpenedStudy, part: int, t_ns: int
) -> Iterator[Panel]:
    """Yield the boards on which a trial may have asked then: those at their usual place."""
    for answer in _questions_at(recording, part, t_ns):
        plan = recording.manifest.plan
        experiment = _experiment(recording, study)
        trial_fields = next(
            t for b in plan["blocks"] for t in b["trials"] if t["trial_id"] == answer["trial_id"]
        )
        response = experiment.responses.get(answer["question"])
        if response is None or isinstance(response, Keys):
            continue
        if not is_on_board(response, experiment.settings):
            continue
        script = TrialScript(Trial(**trial_fields), experiment.settings)
        words = script.words_of(response)
        surfaces = _surfaces_of(recording, len(words[1]))
        for head in _heads_at(recording, part, int(answer["asked_ns"])):
            yield from (script.board_of(response, head, surface) for surface in surfaces)
            yield Panel(*words, board_pose(head), SIZE_M)  # as earlier versions drew it


def _surfaces_of(recording: Recording, choices: int) -> tuple[Surface, ...]:
    """Return what participants may have looked at: a screen with and without keys, a headset."""
    lab_screen = recording.manifest.configuration.get("screen")
    if lab_screen is None:
        return (IN_HEADSET,)
    screen = Screen(**lab_screen)
    upright = Pose(np.array([0.0, screen.eye_height_m, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    placed_screen = PlacedScreen(screen.flat, upright)
    digits = tuple(str(n + 1) for n in range(choices))
    return (Surface(placed_screen, digits), Surface(placed_screen))


def _questions_at(recording: Recording, part: int, t_ns: int) -> Iterator[dict[str, Any]]:
    """Yield what was answered to the questions that a trial asked then."""
    for payload in recording.events_named("answered", part)["payload"]:
        if "asked_ns" in payload and payload["asked_ns"] <= t_ns <= payload["answered_ns"]:
            yield payload


def _answer_soon(recording: Recording, study: OpenedStudy, part: int, t_ns: int) -> int | None:
    """Return the choice of a trial's question that is taken within a moment, or None."""
    for answer in _questions_at(recording, part, t_ns):
        response = _experiment(recording, study).responses.get(answer["question"])
        if response is not None and answer["answered_ns"] - t_ns <= MARKED_NS:
            options = [str(option) for option in response.options]
            return (
                options.index(str(answer["answer"])) if str(answer["answer"]) in options else None
            )
    return None


def _experiment(recording: Recording, study: OpenedStudy) -> StudyExperiment:
    """Return the study as it was performed, made once where a recording is kept."""

    def make() -> StudyExperiment:
        return study.experiment(overrides_of(recording.manifest.plan), is_recorded=True)

    if isinstance(recording, CachedRecording):
        return recording.once("experiment", make)
    return make()


def _bodies(recording: Recording, part: int, drawn_ns: int) -> tuple[OwnBody, ...]:
    """Return the own bodies that participants may have seen: of either sex, sized by one of the
    first samples, posed as in one of the last before the frame.
    """
    schema = recording.stream_schema("body") if "body" in recording.stream_names else None
    if schema is None:
        return ()
    segments = tuple(
        next(f for f in schema.fields if f.name == "position_m")
        .description.partition(": ")[2]
        .split()
    )
    body = of_part(recording, "body", part)
    last = int(np.searchsorted(body["t_host_ns"], drawn_ns, side="right")) - 1
    bodies = []
    for gender in ("female", "male"):
        for first in range(min(FIRST_SAMPLES, last + 1)):
            for newest in range(last, max(first, last - LAST_SAMPLES), -1):
                own = OwnBody(default_casting(f"{gender}_01"), segments)
                for i in (first, newest):
                    own.take_row(_row(recording, "body", body, i))
                bodies.append(own)
    return tuple(bodies)


def _head_at(recording: Recording, part: int, t_ns: int) -> Pose:
    return _heads_at(recording, part, t_ns)[0]


def _heads_at(recording: Recording, part: int, t_ns: int) -> list[Pose]:
    """Return where the head was, and in the samples before that, newest first."""
    head = of_part(recording, "head", part)
    valid_rows = np.flatnonzero(head["valid"] & (head["t_host_ns"] <= t_ns))[::-1][:LAST_SAMPLES]
    poses = [
        Pose(
            head["position_m"][i].astype(np.float64),
            head["orientation_wxyz"][i].astype(np.float64),
        )
        for i in valid_rows
    ]
    return poses or [Pose(np.array([0.0, 1.6, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))]


def _row(recording: Recording, name: str, arrays: dict[str, Any], i: int) -> np.void:
    schema = recording.stream_schema(name)
    if schema is None:
        raise DataError(f"{recording.path}: stream {name} has no schema")
    row = np.zeros(1, schema.dtype)[0]
    for field in schema.fields:
        row[field.name] = arrays[field.name][i]
    return row  # type: ignore[no-any-return]  # an element of a structured array
