"""Warp somebody while being watched: the control loop beside the frame loop.

The frame loop hands over the pose of the moment and the observer's camera, and gets the warped
pose back at once: it only filters towards the newest solution. Solutions come from a thread of
their own, `rate_hz` times a second; on a virtual clock they are made within the frame that is due,
so that runs repeat.
"""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.closing import Closing
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.warping.clips import follow
from visavis.stimuli.motion.warping.control import (
    ControlSettings,
    Situation,
    control_step,
    is_close,
    is_within,
    scale_of,
    see,
    wanted_features,
    warped_turns,
)
from visavis.stimuli.motion.warping.features import FeatureTarget
from visavis.stimuli.motion.warping.outlook import Outlook
from visavis.stimuli.motion.warping.perceived import SeenBody, refuse_observer_inside
from visavis.stimuli.motion.warping.units import WarpingUnit
from visavis.stimuli.picture import Camera

ViewOf = Callable[[Camera], Outlook]
"""What an observer's camera sees of occluders and lamps; called beside the frame loop."""


@dataclass(frozen=True, eq=False)
class OnlineState:
    """The newest solution: offsets (w,) to come to, made for the pose at `t_ns`.

    `original`, `goal` and `seen` (f,) are features of that pose: as it was, as asked for, and
    under the offsets before this step. `sees` is False while the observer's eye is inside the
    body: offsets are held then. `steps` counts solutions.
    """

    t_ns: int
    omega_rad: Vector
    original: Vector
    goal: Vector
    seen: Vector
    is_reached: bool
    sees: bool
    steps: int


@dataclass(frozen=True, eq=False)
class _Moment:
    t_ns: int
    root_m: Vector
    local_wxyz: Vector
    camera: Camera


class OnlineWarp(Closing):
    """Warp one body for one observer, frame by frame. Use as a context manager, or `close` it."""

    def __init__(
        self,
        body: SeenBody,
        targets: tuple[FeatureTarget, ...],
        units: tuple[WarpingUnit, ...],
        view_of: ViewOf,
        *,
        clock: Clock,
        settings: ControlSettings | None = None,
    ) -> None:
        if not targets or not units:
            raise MotionError("a warp needs at least one feature and one warping unit")
        self._body, self._targets, self._units = body, targets, units
        self._view_of, self._clock = view_of, clock
        self._settings = settings or ControlSettings()
        self._pool = ThreadPoolExecutor(self._settings.threads)
        self._period_ns = round(NS_PER_S / self._settings.rate_hz)
        still, nothing = np.zeros(len(units)), np.zeros(len(targets))
        self._state = OnlineState(0, still, nothing, nothing, nothing, True, True, 0)
        self._moment: _Moment | None = None
        self._before: _Moment | None = None
        self._due_ns: int | None = None
        self._shown, self._speed, self._shown_ns = still, still, 0
        self._failure: BaseException | None = None
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def state(self) -> OnlineState:
        """The newest solution."""
        return self._state

    @property
    def shown_rad(self) -> Vector:
        """Offsets (w,) of the last frame."""
        return self._shown

    def turns(self, t_ns: int, root_m: Vector, local_wxyz: Vector, camera: Camera) -> Vector:
        """Return the warped turns (55, 4) of this frame's pose, and ask for solutions for it.

        Raises:
            MotionError: the loop beside failed; its own error is the cause.
        """
        if self._failure is not None:
            raise MotionError(
                "the control loop of visual warping failed; see the error above this one, and "
                "close the warp"
            ) from self._failure
        first = self._moment is None
        elapsed_s = 0.0 if first else (t_ns - self._shown_ns) / NS_PER_S
        self._moment, self._shown_ns = _Moment(t_ns, root_m, local_wxyz, camera), t_ns
        target = self._state.omega_rad
        if elapsed_s > 0 and (target.any() or self._shown.any()):
            self._shown, self._speed = follow(
                self._shown, self._speed, target, elapsed_s, self._settings.smooth_s / 2
            )
        warped = warped_turns(self._body.skeleton, self._units, local_wxyz, self._shown)
        if self._clock.is_virtual:
            self._solve_when_due(t_ns)
        elif self._thread is None:
            self._thread = threading.Thread(target=self._run, name="visual warping", daemon=True)
            self._thread.start()
        return warped

    def close(self) -> None:
        """Stop the loop; at once on a virtual clock, else within a period."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._pool.shutdown()

    def _solve_when_due(self, t_ns: int) -> None:
        if self._due_ns is None or t_ns >= self._due_ns:
            self._due_ns = t_ns + self._period_ns
            self._solve()

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                due_ns = self._clock.now_ns() + self._period_ns
                self._solve()
                self._clock.sleep_until_ns(due_ns)
        except BaseException as failure:
            self._failure = failure

    def _solve(self) -> None:
        """Take one step for the newest pose."""
        moment, before, old = self._moment, self._before, self._state
        if moment is None or (before is not None and before.t_ns == moment.t_ns):
            return
        self._before = moment
        view = self._view_of(moment.camera)
        try:
            refuse_observer_inside(
                self._body, moment.camera.pose.position_m, moment.root_m, moment.local_wxyz
            )
        except MotionError:
            self._state = OnlineState(
                moment.t_ns,
                old.omega_rad,
                old.original,
                old.goal,
                old.seen,
                False,
                False,
                old.steps + 1,
            )
            return
        moving = before is not None and any(t.kind == "motion_coverage" for t in self._targets)
        situation = Situation(
            self._body,
            view,
            self._targets,
            self._units,
            moment.root_m,
            moment.local_wxyz,
            before.root_m if moving and before else None,
            before.local_wxyz if moving and before else None,
        )
        omega = old.omega_rad
        original = see(situation, np.zeros((1, len(omega))))[0]
        wanted = wanted_features(self._targets, original)
        if not omega.any() and is_close(self._targets, view, wanted, original):
            seen, ahead = original, omega
        else:
            step = control_step(
                situation, omega, wanted, scale_of(situation, original), self._settings, self._pool
            )
            seen, ahead = step.features, step.next_rad
        self._state = OnlineState(
            moment.t_ns,
            ahead,
            original,
            wanted,
            seen,
            is_within(wanted, original, seen, situation),
            True,
            old.steps + 1,
        )
