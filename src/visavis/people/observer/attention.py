"""Move the attention, eyes and head of one simulated observer of a scene, compiled.

The model is a chain of visits. A visit brings gaze to a target (a head, a body, a point of the
room), stays there for one or more fixations, and ends with the choice of the next target. All
state lives in structured arrays, so that one call per frame costs about a microsecond; times are
int64 nanoseconds since the stretch of behaviour began. Events happen at their own times, never
at sample times, so the requests for samples cannot change the behaviour.
"""

import math

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.people.observer.eye_movements import (
    angle,
    draw,
    eyes_at,
    gaze_at,
    head_pose,
    log_normal_ns,
    saccade,
    scatter,
    schedule_blink,
)
from visavis.people.observer.state import (
    FAR_FUTURE_NS,
    FREE,
    HEAD,
    IDLE,
    INSTRUCTED,
    N_PENDING,
    NO_TARGET,
    Records,
)


@compiled
def _worth(mind: Records, person: Records, targets: Records, i: int, t_ns: int) -> float:
    """Return the attraction of a target now, apart from its distance in the visual field."""
    m, p, g = mind[0], person[0], targets[i]
    worth = g.appeal
    if g.kind == HEAD:
        worth *= 1.0 + p.early_gain * math.exp(-(t_ns - m.scene_ns) * 1e-9 / p.early_s)
    if g.visits == 0:
        worth *= p.novelty_gain
    else:
        away_s = (t_ns - g.left_ns) * 1e-9
        if g.kind == HEAD:
            worth *= p.familiar_share
            worth *= 1.0 + p.second_look_gain * math.exp(-away_s / p.second_look_s)
        if g.is_noticed == 1:
            worth *= p.return_gain * p.return_habituation ** (g.visits - 1)
            if g.caught == 1:
                worth *= p.caught_return
        elif g.lost_ns >= 0:
            worth *= 1.0 + p.recheck_gain * math.exp(-(t_ns - g.lost_ns) * 1e-9 / p.recheck_s)
        worth *= 1.0 - math.exp(-away_s / p.recovery_s)
    if g.visits == 0 and g.is_noticed == 1:
        worth *= 1.0 + p.capture_gain
    return float(worth)


@compiled
def _choose(
    mind: Records,
    person: Records,
    segments: Records,
    targets: Records,
    scratch: npt.NDArray[np.float64],
    t_ns: int,
) -> int:
    """Draw the next target in proportion to its worth, near ones before far ones."""
    m, p = mind[0], person[0]
    gaze = np.empty(3)
    gaze_at(segments[m.segment], p.drift_rad, 0.0, t_ns, gaze)
    total = 0.0
    for i in range(m.n_targets):
        g = targets[i]
        apart = angle(gaze, g.direction)
        scratch[i] = 0.0
        if g.kind == HEAD and g.contact == 1 and g.is_noticed == 0 and i != m.target:
            chance = p.parafovea_p * math.exp(-((apart / p.parafovea_rad) ** 2))
            if m.target == NO_TARGET:
                aside = math.atan2(-g.direction[0], -g.direction[2]) - m.rest_yaw
                chance = p.onset_p * math.exp(-((aside / p.onset_rad) ** 2))
            if chance > 1e-4 and draw(mind) < chance:
                g.is_noticed = 1
        if i != m.target:
            scratch[i] = _worth(mind, person, targets, i, t_ns) * math.exp(-apart / p.amplitude_rad)
            total += scratch[i]
    left = total * draw(mind)
    target = m.n_targets - 1
    for i in range(m.n_targets):
        left -= scratch[i]
        if left < 0.0 and scratch[i] > 0.0:
            target = i
            break
    return int(target)


@compiled
def _hold_ns(mind: Records, person: Records, targets: Records, i: int) -> int:
    """Draw the time by which contact prolongs a visit; negative in people who avert their eyes."""
    p = person[0]
    mean_s = p.hold_s * p.hold_growth ** max(0, targets[i].visits - 1)
    if targets[i].caught == 1:
        mean_s *= p.caught_hold
    if mean_s < 0.0:
        return -log_normal_ns(mind, -mean_s, p.hold_log_sd)
    return log_normal_ns(mind, mean_s, p.hold_log_sd)


@compiled
def _visit(
    mind: Records,
    person: Records,
    segments: Records,
    targets: Records,
    scratch: npt.NDArray[np.float64],
    t_ns: int,
) -> None:
    """Leave the present target and go to the next."""
    m, p = mind[0], person[0]
    target = _choose(mind, person, segments, targets, scratch, t_ns)
    if m.target != NO_TARGET:
        targets[m.target].left_ns = t_ns
    m.target = target
    m.saw_change = 0
    m.notice_ns = FAR_FUTURE_NS
    m.arousal_01 = 0.0
    g = targets[target]
    scatter(mind, g.direction, p.scatter_share * g.radius_rad, m.aim)
    m.aim_dioptre = 1.0 / g.distance_m
    landing = np.empty(3)
    gaze = np.empty(3)
    gaze_at(segments[m.segment], p.drift_rad, 0.0, t_ns, gaze)
    short = 0.0
    if angle(gaze, m.aim) > 0.09 and draw(mind) < p.undershoot_p:
        short = p.undershoot_share * (0.5 + draw(mind))
    length = 0.0
    for k in range(3):
        landing[k] = (1 - short) * m.aim[k] + short * gaze[k]
        length += landing[k] ** 2
    for k in range(3):
        landing[k] /= math.sqrt(length)
    arrival = saccade(mind, person, segments, t_ns, landing, m.aim_dioptre)
    m.correction = 0
    lasts = log_normal_ns(mind, p.other_visit_s, p.other_visit_log_sd)
    if g.kind == HEAD:
        lasts = log_normal_ns(mind, p.head_visit_s, p.head_visit_log_sd)
        if g.contact != g.is_noticed:
            if draw(mind) < p.notice_p:
                m.notice_ns = arrival + log_normal_ns(mind, p.notice_s, p.notice_log_sd)
        elif g.is_noticed == 1:
            lasts += _hold_ns(mind, person, targets, target)
            m.arousal_01 = 1.0
    g.visits += 1
    lasts = max(lasts, 60_000_000)
    m.arrival_ns = arrival
    m.visit_end_ns = arrival + lasts
    if short > 0.0:
        m.correction = 1
        wait = log_normal_ns(mind, p.correction_s, 0.25)
        m.next_ns = arrival + wait
        m.visit_end_ns += wait
    else:
        m.next_ns = _fixation_end(mind, person, arrival)


@compiled
def _fixation_end(mind: Records, person: Records, start_ns: int) -> int:
    """Draw how long this fixation of the visit lasts; no remainder is shorter than 0.1 s."""
    m, p = mind[0], person[0]
    end = start_ns + log_normal_ns(mind, p.fixation_s, p.fixation_log_sd)
    if end > m.visit_end_ns - 100_000_000:
        end = max(start_ns, m.visit_end_ns)  # a visit may have been cut short before
    return int(end)


@compiled
def _refixate(
    mind: Records, person: Records, segments: Records, targets: Records, t_ns: int
) -> None:
    """Stay with the target: correct an undershoot, or move on to another part of it."""
    m, p = mind[0], person[0]
    if m.correction == 1:
        m.correction = 0
    elif m.mode == INSTRUCTED:
        scatter(mind, m.instructed, 0.003, m.aim)
    else:
        g = targets[m.target]
        scatter(mind, g.direction, p.scatter_share * g.radius_rad, m.aim)
    arrival = saccade(mind, person, segments, t_ns, m.aim, m.aim_dioptre)
    m.next_ns = _fixation_end(mind, person, arrival)
    if m.mode == INSTRUCTED:
        m.next_ns = arrival + log_normal_ns(mind, 3.0 * p.fixation_s, p.fixation_log_sd)


@compiled
def _notice(mind: Records, person: Records, targets: Records, t_ns: int) -> None:
    """Notice that contact with the visited agent began or ended; change the visit's length."""
    m, p = mind[0], person[0]
    m.notice_ns = FAR_FUTURE_NS
    if m.target == NO_TARGET or targets[m.target].kind != HEAD:
        return
    g = targets[m.target]
    if g.contact == 1 and g.is_noticed == 0:
        g.is_noticed = 1
        g.caught = 1 if m.saw_change == 1 or g.visits > 1 else 0
        m.arousal_01 = 1.0
        m.visit_end_ns = max(t_ns, m.visit_end_ns + _hold_ns(mind, person, targets, m.target))
    elif g.contact == 0 and (g.is_noticed == 1 or m.saw_change == 1):
        g.is_noticed = 0
        g.lost_ns = t_ns
        m.arousal_01 = 0.5
        stays_ns = log_normal_ns(mind, abs(p.startle_s), p.hold_log_sd)
        if p.startle_s < 0.0:
            m.visit_end_ns = max(t_ns, m.visit_end_ns - stays_ns)
        else:
            m.visit_end_ns = max(m.visit_end_ns, t_ns + stays_ns)


@compiled
def _apply_contacts(mind: Records, person: Records, targets: Records, t_ns: int) -> None:
    """Store which agents now look at the observer."""
    m, p = mind[0], person[0]
    contacts = m.pending_contacts[m.pending_first]
    m.pending_first = (m.pending_first + 1) % N_PENDING
    m.pending_count -= 1
    m.contacts = contacts
    for i in range(m.n_targets):
        g = targets[i]
        if g.kind != HEAD:
            continue
        now = (contacts >> g.agent) & 1
        if now != g.contact:
            g.contact = now
            if m.mode != FREE:
                continue
            if i == m.target:
                m.saw_change = 1
                seen_ns = max(t_ns, m.arrival_ns)
                m.notice_ns = seen_ns + log_normal_ns(mind, p.change_notice_s, p.notice_log_sd)


@compiled
def advance(
    mind: Records,
    person: Records,
    segments: Records,
    targets: Records,
    scratch: npt.NDArray[np.float64],
    until_ns: int,
) -> None:
    """Perform all events up to this time."""
    m = mind[0]
    while True:
        pending_ns = FAR_FUTURE_NS
        if m.pending_count > 0:
            pending_ns = m.pending_ns[m.pending_first]
        t = min(m.next_ns, m.notice_ns, pending_ns, m.blink_end_ns)
        if t > until_ns:
            break
        if t == pending_ns:
            _apply_contacts(mind, person, targets, t)
        elif t == m.blink_end_ns:
            schedule_blink(mind, person, t)
        elif t == m.notice_ns:
            _notice(mind, person, targets, t)
        elif m.mode == IDLE:
            m.next_ns = FAR_FUTURE_NS
        elif m.mode == INSTRUCTED or m.correction == 1 or (m.target >= 0 and t < m.visit_end_ns):
            _refixate(mind, person, segments, targets, t)
        else:
            _visit(mind, person, segments, targets, scratch, t)
    m.now_ns = max(m.now_ns, until_ns)


@compiled
def advance_and_pose(
    mind: Records,
    person: Records,
    segments: Records,
    targets: Records,
    scratch: npt.NDArray[np.float64],
    t_ns: int,
    position: npt.NDArray[np.float64],
    orientation: npt.NDArray[np.float64],
) -> None:
    """Advance to a time; fill the head's position (3,) and orientation (4,) there."""
    advance(mind, person, segments, targets, scratch, t_ns)
    head_pose(mind, person, segments, t_ns, position, orientation)


@compiled
def heads(
    mind: Records,
    person: Records,
    segments: Records,
    targets: Records,
    scratch: npt.NDArray[np.float64],
    t_ns: npt.NDArray[np.int64],
    positions: npt.NDArray[np.float64],
    orientations: npt.NDArray[np.float64],
) -> None:
    """Advance to each time in turn; fill head poses (n, 3) and (n, 4)."""
    for i in range(t_ns.shape[0]):
        advance_and_pose(
            mind, person, segments, targets, scratch, t_ns[i], positions[i], orientations[i]
        )


@compiled
def sense(
    mind: Records,
    person: Records,
    segments: Records,
    targets: Records,
    scratch: npt.NDArray[np.float64],
    t_ns: npt.NDArray[np.int64],
    origin_ns: int,
    eyes: npt.NDArray[np.float64],
    positions: npt.NDArray[np.float64],
    orientations: npt.NDArray[np.float64],
) -> None:
    """Advance to each time in turn; fill eye states (n, 8), head poses (n, 3) and (n, 4)."""
    for i in range(t_ns.shape[0]):
        t = t_ns[i] - origin_ns
        advance_and_pose(mind, person, segments, targets, scratch, t, positions[i], orientations[i])
        eyes_at(mind, person, segments, t, positions[i], orientations[i], eyes[i])
