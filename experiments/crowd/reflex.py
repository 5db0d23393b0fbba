"""Answer contact at once: every body sample compared with the crowd when it arrives."""

import threading

import numpy as np

from visavis.experiments.crowd.design import CrowdParameters
from visavis.experiments.crowd.haptics import BandOrder, ContactAnswer
from visavis.experiments.crowd.tracking import TrackingWatch, never_tracked
from visavis.lab.clock import NS_PER_S
from visavis.protocol.plan.steps import BodyView, Play, Scalar, Silence
from visavis.stimuli.contact.body import ARM_JOINTS
from visavis.stimuli.scenes.station_crowd import Crowd


class ContactReflex:
    """The bands' answers to contact in one walk, and an account of them for the recording.

    `moved` holds the segments seen to move so far in the session and is added to at the end of the
    walk: one that is dead from a walk's first sample on is then known to be dead.
    `answer` may run in the tracker's thread, everything else runs in the session's.
    """

    def __init__(
        self,
        crowd: Crowd,
        start_ns: int,
        quiet_ns: int,
        params: CrowdParameters,
        *,
        vibrates: bool,
        moved_segments: set[tuple[str, int]] | None = None,
    ) -> None:
        self._moved_segments: set[tuple[str, int]] = (
            set() if moved_segments is None else moved_segments
        )
        self._crowd, self._start_ns, self._quiet_ns = crowd, start_ns, quiet_ns
        self._params, self._vibrates = params, vibrates
        self._lock = threading.Lock()
        self._contacts: ContactAnswer | None = None
        self._watch: TrackingWatch | None = None
        self._orders: list[BandOrder] = []

    def answer(self, body: BodyView) -> list[Play | Silence]:
        """Compare samples with the crowd; return what the bands shall do at once."""
        with self._lock:
            orders: list[BandOrder] = []
            for i, t_ns in enumerate(body.t_ns.tolist()):
                if t_ns < self._start_ns:
                    continue
                contacts, watch = self._ready(body, i)
                if watch.believes(body, i, t_ns):
                    crowd_t_s = (t_ns - self._start_ns) / NS_PER_S
                    orders += contacts.sample(
                        t_ns, crowd_t_s, watch.believed_m(body, i), body.orientation_wxyz[i]
                    )
                else:
                    orders += contacts.silence(t_ns)
            return self._note(orders)

    def look_after(self, t_ns: int) -> list[Play | Silence]:
        """Silence the bands when the tracker has said nothing for too long."""
        with self._lock:
            contacts, watch = self._contacts, self._watch
            if contacts is None or watch is None or not watch.is_silent(t_ns):
                return []
            return self._note(contacts.silence(t_ns))

    def end(self, t_ns: int) -> list[Play | Silence]:
        """Silence whatever still runs at the walk's end."""
        with self._lock:
            if self._watch is not None:
                self._watch.end(t_ns)
            return [] if self._contacts is None else self._note(self._contacts.silence(t_ns))

    def take_orders(self) -> list[BandOrder]:
        """Return what was ordered since the last call, for the recording."""
        with self._lock:
            orders, self._orders = self._orders, []
        return orders

    def account(self) -> tuple[dict[str, Scalar | None], list[str]]:
        """Return the trial row's columns about tracking, and its flags."""
        if self._watch is None:
            return never_tracked()
        return self._watch.row(), self._watch.flags()

    def _note(self, orders: list[BandOrder]) -> list[Play | Silence]:
        self._orders += orders
        return [self._step_of(order) for order in orders] if self._vibrates else []

    def _step_of(self, order: BandOrder) -> Play | Silence:
        if order.kind == "end":
            return Silence(order.role)
        return Play(order.role, self._params.vibration, order.motors)

    def _ready(self, body: BodyView, i: int) -> tuple[ContactAnswer, TrackingWatch]:
        if self._contacts is None or self._watch is None:
            params = self._params
            self._watch = TrackingWatch(
                self._start_ns, self._quiet_ns, body.segments, self._moved_segments
            )
            self._contacts = ContactAnswer(
                self._crowd,
                body.segments,
                params.vibration,
                nearest_motor=params.nearest_motor,
                update_hz=params.haptic_update_hz,
            )
            self._contacts.fit(body.position_m[i])
        return self._contacts, self._watch


def load_contact(crowd: Crowd, params: CrowdParameters) -> None:
    """Load the kernels of contact and the people's figures: the first sample must not wait."""
    segments = (*ARM_JOINTS, "hips")
    position_m = np.zeros((1, len(segments), 3))
    position_m[..., [0, 2]] = crowd.position_m[0]
    upright = np.zeros((1, len(segments), 4))
    upright[..., 0] = 1.0
    body = BodyView(
        segments, np.zeros(1, np.int64), position_m, upright, np.ones((1, len(segments)), bool)
    )
    ContactReflex(crowd, 0, 1, params, vibrates=False).answer(body)
