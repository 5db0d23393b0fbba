"""Outside events of a simulated observer: stretches, scenes, gaze contact, instructions.

These write into the state that `attention.advance` moves on.
"""

import math

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.people.observer.eye_movements import (
    draw,
    log_normal_ns,
    schedule_blink,
)
from visavis.people.observer.state import (
    FAR_FUTURE_NS,
    FREE,
    IDLE,
    INSTRUCTED,
    N_PENDING,
    NO_TARGET,
    Records,
)


@compiled
def see_gaze(
    mind: Records,
    eyes_of_agents: npt.NDArray[np.float64],
    gaze: npt.NDArray[np.float64],
    openness: npt.NDArray[np.float64],
    seat: npt.NDArray[np.float64],
    cos_tolerance: float,
    t_ns: int,
) -> bool:
    """Compare the agents' gaze with the position of the observer's eyes; store changes, and tell
    whether there are any.

    An agent whose lids are closed tells nothing, so it keeps what it showed before. At most 62
    agents, one bit each.
    """
    m = mind[0]
    contacts = m.last_seen_contacts
    for i in range(gaze.shape[0]):
        if openness[i] < 0.5:
            continue
        x = seat[0] - eyes_of_agents[i, 0]
        y = seat[1] - eyes_of_agents[i, 1]
        z = seat[2] - eyes_of_agents[i, 2]
        dot = x * gaze[i, 0] + y * gaze[i, 1] + z * gaze[i, 2]
        bit = np.int64(1) << np.int64(i)
        if dot > cos_tolerance * math.sqrt(x * x + y * y + z * z):
            contacts |= bit
        else:
            contacts &= ~bit
    if contacts == m.last_seen_contacts:
        return False
    m.last_seen_contacts = contacts
    if m.pending_count == N_PENDING:
        m.pending_first = (m.pending_first + 1) % N_PENDING
        m.pending_count -= 1
    k = (m.pending_first + m.pending_count) % N_PENDING
    m.pending_ns[k] = max(t_ns, m.now_ns)
    m.pending_contacts[k] = contacts
    m.pending_count += 1
    return True


@compiled
def begin_stretch(
    mind: Records,
    person: Records,
    segments: Records,
    gaze: npt.NDArray[np.float64],
    dioptre: float,
) -> None:
    """Reset the state to time zero of a stretch.

    `key` and `blink_key` must have been set; gaze rests on the direction given.
    """
    m, p = mind[0], person[0]
    m.draws = 0
    m.blinks_drawn = 0
    m.now_ns = 0
    m.mode = IDLE
    m.target = NO_TARGET
    m.n_targets = 0
    m.next_ns = FAR_FUTURE_NS
    m.notice_ns = FAR_FUTURE_NS
    m.visit_end_ns = 0
    m.arrival_ns = 0
    m.saw_change = 0
    m.correction = 0
    m.segment = 0
    m.pending_first = 0
    m.pending_count = 0
    m.contacts = 0
    m.last_seen_contacts = 0
    m.scene_ns = 0
    m.arousal_01 = 0.0
    m.brightness_01 = 0.0
    for k in range(4):
        m.sway_phase[k] = 2.0 * math.pi * draw(mind)
    s = segments[0]
    # Far in the past: a tracker's thread may still measure times before the stretch.
    s.start_ns = -FAR_FUTURE_NS
    s.saccade_ns = 0
    s.origin_dioptre = s.landing_dioptre = dioptre
    for k in range(3):
        s.origin[k] = s.landing[k] = gaze[k]
        s.axis_a[k] = s.axis_b[k] = 0.0
        m.aim[k] = gaze[k]
    for k in range(4):
        s.phase[k] = 0.0
    m.aim_dioptre = dioptre
    s.head_yaw = s.goal_yaw = math.atan2(-gaze[0], -gaze[2])
    s.head_pitch = s.goal_pitch = p.head_gain * math.asin(max(-1.0, min(1.0, gaze[1])))
    s.head_yaw_rate = s.head_pitch_rate = 0.0
    s.pupil_mm = s.pupil_goal_mm = p.pupil_dark_mm
    m.blink_start_ns = m.blink_end_ns = -1
    schedule_blink(mind, person, 0)
    m.last_blink_start_ns = m.last_blink_end_ns = -1


@compiled
def begin_scene(
    mind: Records,
    person: Records,
    key: np.uint64,
    brightness_01: float,
    n_targets: int,
    t_ns: int,
) -> None:
    """Meet a scene that appears at this time; look around once it has been taken in.

    Random numbers restart at the beginning of stream `key`, so that an image flashed before this
    scene has no effect.
    """
    m, p = mind[0], person[0]
    m.key = key
    m.draws = 0
    m.brightness_01 = brightness_01
    m.n_targets = n_targets
    m.target = NO_TARGET
    m.notice_ns = FAR_FUTURE_NS
    m.correction = 0
    m.scene_ns = t_ns
    m.last_seen_contacts = 0
    m.contacts = 0
    m.pending_count = 0
    m.arousal_01 = 0.0
    if m.mode != INSTRUCTED:
        m.mode = FREE if n_targets > 0 else IDLE
        m.next_ns = max(t_ns, m.now_ns) + log_normal_ns(mind, p.onset_latency_s, 0.25)
        m.visit_end_ns = m.next_ns
    if m.mode == IDLE:
        m.next_ns = FAR_FUTURE_NS


@compiled
def instruct(
    mind: Records,
    person: Records,
    direction: npt.NDArray[np.float64],
    dioptre: float,
    t_ns: int,
) -> None:
    """Obey an instruction to look in a direction until it ends."""
    m, p = mind[0], person[0]
    m.mode = INSTRUCTED
    m.target = NO_TARGET
    m.notice_ns = FAR_FUTURE_NS
    m.correction = 0
    for k in range(3):
        m.instructed[k] = direction[k]
    m.aim_dioptre = m.instructed_dioptre = dioptre
    m.next_ns = max(t_ns, m.now_ns) + log_normal_ns(mind, p.onset_latency_s, 0.25)


@compiled
def release(mind: Records, person: Records, t_ns: int) -> None:
    """End an instruction; look freely again if there is a scene."""
    m, p = mind[0], person[0]
    if m.mode != INSTRUCTED:
        return
    m.mode = FREE if m.n_targets > 0 else IDLE
    m.target = NO_TARGET
    m.next_ns = max(t_ns, m.now_ns) + log_normal_ns(mind, p.onset_latency_s, 0.25)
    m.visit_end_ns = m.next_ns
    if m.mode == IDLE:
        m.next_ns = FAR_FUTURE_NS
