"""Move eyes, head, lids and pupils between the decisions of `attention`, compiled.

Everything is a closed form of the time since a saccade began, so it can be asked for at any
time, in any chunks, and within the last sixteen saccades also backwards.
"""

import math

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.people.observer.state import N_SEGMENTS, Record, Records
from visavis.stimuli.motion.rhythm_kernels import ease


@compiled
def _uniform(key: np.uint64, count: np.uint64) -> float:
    """Return number `count` of the stream `key`, in (0, 1): SplitMix64 (Steele et al. 2014)."""
    z = key + (count + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return float((np.float64(z >> np.uint64(11)) + 0.5) * (1.0 / 9007199254740992.0))


@compiled
def draw(mind: Records) -> float:
    """Draw from (0, 1), the next number of this stretch."""
    m = mind[0]
    value = _uniform(m.key, m.draws)
    m.draws += np.uint64(1)
    return value


@compiled
def _normal(mind: Records) -> float:
    radius = math.sqrt(-2.0 * math.log(draw(mind)))
    return radius * math.cos(2.0 * math.pi * draw(mind))


@compiled
def log_normal_ns(mind: Records, mean_s: float, log_sd: float) -> int:
    """Draw a duration whose mean (not median) is `mean_s`."""
    value = mean_s * math.exp(log_sd * _normal(mind) - 0.5 * log_sd * log_sd)
    return int(value * 1e9)


@compiled
def angle(a: npt.NDArray[np.float64], b: npt.NDArray[np.float64]) -> float:
    """Return the angle between two unit vectors in radians."""
    chord = math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)
    return 2.0 * math.asin(min(1.0, chord / 2.0))


@compiled
def schedule_blink(mind: Records, person: Records, after_ns: int) -> None:
    """Draw the next blink; intervals are 0.3 s plus an exponential, lids shut 100 to 200 ms."""
    m = mind[0]
    u = _uniform(m.blink_key, m.blinks_drawn)
    v = _uniform(m.blink_key, m.blinks_drawn + np.uint64(1))
    m.blinks_drawn += np.uint64(2)
    m.last_blink_start_ns, m.last_blink_end_ns = m.blink_start_ns, m.blink_end_ns
    wait_s = 0.3 - max(0.2, person[0].blink_interval_s - 0.3) * math.log(u)
    m.blink_start_ns = after_ns + np.int64(wait_s * 1e9)
    m.blink_end_ns = m.blink_start_ns + np.int64(person[0].blink_s * (0.7 + 0.6 * v) * 1e9)


@compiled
def _head_at(s: Record, rate: float, t_ns: int, out: npt.NDArray[np.float64]) -> None:
    """Fill yaw, pitch and their rates: a critically damped turn towards the segment's goal."""
    dt = max(0.0, (t_ns - s.start_ns) * 1e-9)
    fade = math.exp(-rate * dt)
    away = s.head_yaw - s.goal_yaw
    slope = s.head_yaw_rate + rate * away
    out[0] = s.goal_yaw + (away + slope * dt) * fade
    out[2] = (slope - rate * (away + slope * dt)) * fade
    away = s.head_pitch - s.goal_pitch
    slope = s.head_pitch_rate + rate * away
    out[1] = s.goal_pitch + (away + slope * dt) * fade
    out[3] = (slope - rate * (away + slope * dt)) * fade


@compiled
def _pupil_at(s: Record, tau_s: float, t_ns: int) -> float:
    dt = max(0.0, (t_ns - s.start_ns) * 1e-9)
    return float(s.pupil_goal_mm + (s.pupil_mm - s.pupil_goal_mm) * math.exp(-dt / tau_s))


@compiled
def gaze_at(
    s: Record, drift: float, tremor: float, t_ns: int, out: npt.NDArray[np.float64]
) -> float:
    """Fill the gaze direction from the seat and return 1 / distance."""
    since = t_ns - s.start_ns
    share = 1.0
    if since < s.saccade_ns:
        share = ease(since / s.saccade_ns)
    after = max(0.0, (since - s.saccade_ns) * 1e-9)
    a = drift * (math.sin(2.6 * after + s.phase[0]) - math.sin(s.phase[0]))
    b = drift * (math.sin(3.7 * after + s.phase[1]) - math.sin(s.phase[1]))
    if after > 0.0:
        a += tremor * math.sin(520.0 * after + s.phase[2])
        b += tremor * math.sin(470.0 * after + s.phase[3])
    before, now = 1 - share, share
    amplitude = angle(s.origin, s.landing)
    if amplitude > 1e-6 and share < 1.0:
        before = math.sin((1 - share) * amplitude) / math.sin(amplitude)
        now = math.sin(share * amplitude) / math.sin(amplitude)
    length = 0.0
    for k in range(3):
        out[k] = before * s.origin[k] + now * s.landing[k]
        out[k] += a * s.axis_a[k] + b * s.axis_b[k]
        length += out[k] * out[k]
    length = math.sqrt(length)
    for k in range(3):
        out[k] /= length
    return float((1 - share) * s.origin_dioptre + share * s.landing_dioptre)


@compiled
def _pupil_goal(mind: Records, person: Records) -> float:
    m, p = mind[0], person[0]
    light = p.pupil_dark_mm + (p.pupil_bright_mm - p.pupil_dark_mm) * m.brightness_01
    return float(light + p.pupil_arousal_mm * m.arousal_01)


@compiled
def _head_goal(eccentric: float, gain: float, eye_range: float) -> float:
    """Share a gaze shift between head and eyes; eyes never stay beyond their range."""
    share = gain * eccentric
    if eccentric - share > eye_range:
        share = eccentric - eye_range
    elif eccentric - share < -eye_range:
        share = eccentric + eye_range
    return share


@compiled
def saccade(
    mind: Records,
    person: Records,
    segments: Record,
    t_ns: int,
    landing: npt.NDArray[np.float64],
    dioptre: float,
) -> int:
    """Begin a saccade now and return when it ends; the head follows later and slower."""
    m, p = mind[0], person[0]
    old = segments[m.segment]
    origin = np.empty(3)
    head = np.empty(4)
    origin_dioptre = gaze_at(old, p.drift_rad, 0.0, t_ns, origin)
    _head_at(old, p.head_rate, t_ns, head)
    pupil = _pupil_at(old, p.pupil_s, t_ns)
    m.segment = (m.segment + 1) % N_SEGMENTS
    s = segments[m.segment]
    amplitude = angle(origin, landing)
    s.start_ns = t_ns
    s.saccade_ns = np.int64((p.saccade_s + p.saccade_s_per_rad * amplitude) * 1e9)
    s.origin_dioptre, s.landing_dioptre = origin_dioptre, dioptre
    flat = max(1e-6, math.hypot(landing[0], landing[2]))
    s.axis_a[0], s.axis_a[1], s.axis_a[2] = -landing[2] / flat, 0.0, landing[0] / flat
    s.axis_b[0], s.axis_b[1], s.axis_b[2] = (
        -landing[0] * landing[1] / flat,
        flat,
        -landing[2] * landing[1] / flat,
    )
    for k in range(3):
        s.origin[k], s.landing[k] = origin[k], landing[k]
    for k in range(4):
        s.phase[k] = 2.0 * math.pi * draw(mind)
    s.head_yaw, s.head_pitch = head[0], head[1]
    s.head_yaw_rate, s.head_pitch_rate = head[2], head[3]
    yaw = math.atan2(-landing[0], -landing[2])
    pitch = math.asin(max(-1.0, min(1.0, landing[1])))
    turn = (yaw - m.rest_yaw + math.pi) % (2.0 * math.pi) - math.pi
    s.goal_yaw = m.rest_yaw + _head_goal(turn, p.head_gain, p.eye_range_rad)
    s.goal_pitch = m.rest_pitch + _head_goal(
        pitch - m.rest_pitch, 0.6 * p.head_gain, p.eye_range_rad
    )
    s.pupil_mm, s.pupil_goal_mm = pupil, _pupil_goal(mind, person)
    return int(t_ns + s.saccade_ns)


@compiled
def scatter(
    mind: Records,
    centre: npt.NDArray[np.float64],
    spread_rad: float,
    out: npt.NDArray[np.float64],
) -> None:
    """Aim near a direction: normal errors in its tangent plane."""
    a, b = spread_rad * _normal(mind), spread_rad * _normal(mind)
    flat = max(1e-6, math.hypot(centre[0], centre[2]))
    out[0] = centre[0] - a * centre[2] / flat - b * centre[0] * centre[1] / flat
    out[1] = centre[1] + b * flat
    out[2] = centre[2] + a * centre[0] / flat - b * centre[2] * centre[1] / flat
    length = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    for k in range(3):
        out[k] /= length


@compiled
def _segment_at(mind: Records, segments: Record, t_ns: int) -> int:
    k = mind[0].segment
    for _ in range(N_SEGMENTS - 1):
        if segments[k].start_ns <= t_ns:
            break
        k = (k + N_SEGMENTS - 1) % N_SEGMENTS
    return int(k)


@compiled
def _lids(start_ns: int, end_ns: int, t_ns: int) -> float:
    """Return how open the eyes are in one blink: shut in 40 ms, open again in 60 ms."""
    if t_ns <= start_ns - 40_000_000 or t_ns >= end_ns + 60_000_000:
        return 1.0
    if t_ns < start_ns:
        return (start_ns - t_ns) / 40e6
    if t_ns > end_ns:
        return (t_ns - end_ns) / 60e6
    return 0.0


@compiled
def head_pose(
    mind: Records,
    person: Records,
    segments: Record,
    t_ns: int,
    position: npt.NDArray[np.float64],
    orientation: npt.NDArray[np.float64],
) -> None:
    """Fill the midpoint between the eyes (3,) and the head's orientation (4,) at a time."""
    m, p = mind[0], person[0]
    turn = np.empty(4)
    _head_at(segments[_segment_at(mind, segments, t_ns)], p.head_rate, t_ns, turn)
    cy, sy = math.cos(turn[0] / 2), math.sin(turn[0] / 2)
    cp, sp = math.cos(turn[1] / 2), math.sin(turn[1] / 2)
    orientation[0], orientation[1] = cy * cp, cy * sp
    orientation[2], orientation[3] = sy * cp, -sy * sp
    # The head turns about the neck, behind and below the eyes; the trunk sways a little.
    t = t_ns * 1e-9
    back, up = p.neck_back_m, p.neck_up_m
    forward = back * math.cos(turn[1]) - up * math.sin(turn[1])
    rise = back * math.sin(turn[1]) + up * math.cos(turn[1])
    sway_x = p.sway_m * math.sin(1.5 * t + m.sway_phase[0])
    sway_x += 0.5 * p.sway_m * math.sin(3.9 * t + m.sway_phase[1])
    sway_z = p.sway_m * math.sin(1.2 * t + m.sway_phase[2])
    sway_z += 0.5 * p.sway_m * math.sin(3.1 * t + m.sway_phase[3])
    position[0] = p.seat_x - forward * math.sin(turn[0]) + sway_x
    position[1] = p.seat_y - up + rise
    position[2] = p.seat_z + back - forward * math.cos(turn[0]) + sway_z


@compiled
def eyes_at(
    mind: Records,
    person: Records,
    segments: Records,
    t_ns: int,
    position: npt.NDArray[np.float64],
    orientation: npt.NDArray[np.float64],
    eyes: npt.NDArray[np.float64],
) -> None:
    """Fill one eye state (8,) in the order of EYES_DTYPE, given the head's pose then."""
    m, p = mind[0], person[0]
    gaze, aim = np.empty(3), np.empty(3)
    s = segments[_segment_at(mind, segments, t_ns)]
    distance = 1.0 / gaze_at(s, p.drift_rad, p.tremor_rad, t_ns, gaze)
    w, x, y, z = orientation[0], -orientation[1], -orientation[2], -orientation[3]
    aim[0] = p.seat_x + distance * gaze[0] - position[0]
    aim[1] = p.seat_y + distance * gaze[1] - position[1]
    aim[2] = p.seat_z + distance * gaze[2] - position[2]
    tx = 2 * (y * aim[2] - z * aim[1])
    ty = 2 * (z * aim[0] - x * aim[2])
    tz = 2 * (x * aim[1] - y * aim[0])
    ax = aim[0] + w * tx + y * tz - z * ty
    ay = aim[1] + w * ty + z * tx - x * tz
    az = aim[2] + w * tz + x * ty - y * tx
    for eye in range(2):
        ex = ax + (0.5 - eye) * p.ipd_m
        length = math.sqrt(ex * ex + ay * ay + az * az)
        eyes[3 * eye] = ex / length
        eyes[3 * eye + 1] = ay / length
        eyes[3 * eye + 2] = az / length
    eyes[6] = min(
        _lids(m.blink_start_ns, m.blink_end_ns, t_ns),
        _lids(m.last_blink_start_ns, m.last_blink_end_ns, t_ns),
    )
    hippus = 0.05 * math.sin(1.9 * t_ns * 1e-9 + m.sway_phase[0])
    eyes[7] = _pupil_at(s, p.pupil_s, t_ns) + hippus
