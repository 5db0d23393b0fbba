"""A posture as a few numbers: what procedural motions decide and the solver turns into joints.

One row of `SIZE` numbers a person, metres and radians. A motion writes it in the person's own frame
(origin on the floor, facing −z, y up), `placed_rows` carries it to world. Rows may be mixed
linearly: feet stay on the floor, hands pass smoothly from one hold to the next. Left and right arms
are written alike, as for the left side: the solver reflects the right one.
"""

from typing import Final

HIPS: Final = 0
"""x, y, z of the hips."""
HIPS_YAW: Final = 3
"""To the left."""
HIPS_LEAN: Final = 4
"""Forward."""
HIPS_ROLL: Final = 5
"""To the right."""
TRUNK_YAW: Final = 6
TRUNK_LEAN: Final = 7
TRUNK_ROLL: Final = 8
HEAD_YAW: Final = 9
HEAD_PITCH: Final = 10
"""Up."""
HEAD_ROLL: Final = 11

LEG: Final = 12
"""Start of the left leg; the right one follows after `LEG_SIZE`."""
LEG_SIZE: Final = 8
ANKLE: Final = 0
"""x, y, z of the ankle joint."""
FOOT_YAW: Final = 3
FOOT_PITCH: Final = 4
"""Heel up."""
FOOT_ROLL: Final = 5
TOE_BEND: Final = 6
"""Toes up against the foot."""
KNEE_OUT: Final = 7

ARM: Final = 28
"""Start of the left arm; the right one follows after `ARM_SIZE`."""
ARM_SIZE: Final = 105
SHOULDER_UP: Final = 0
SHOULDER_FORWARD: Final = 1
ARM_FLEX: Final = 2
"""Upper arm forward from hanging."""
ARM_OUT: Final = 3
"""Upper arm away from the body."""
ARM_INWARD: Final = 4
"""Turn of the upper arm that brings the bent forearm before the body."""
ELBOW: Final = 5
PRONATION: Final = 6
WRIST: Final = 7
"""Towards the palm."""
DEVIATION: Final = 8
"""Towards the thumb."""
POLE: Final = 9
"""Where the elbow of a held hand goes, (3,) in the chest's axes."""
CURL: Final = 12
"""Index, middle, ring, little: 0 straight, 1 a fist."""
THUMB: Final = 16
OPPOSE: Final = 17
SPREAD: Final = 18
KNUCKLE: Final = 19
"""Index, middle, ring, little: how much farther a knuckle bends than its finger's curl says."""
THUMB_IN: Final = 23
"""The whole thumb towards the fingers, in the plane of the palm."""
ELBOW_BESIDE: Final = 24
"""The elbow of a held hand is at least so far from the middle of the chest, to its side."""
HOLD: Final = 25
"""Start of the holds: weight, then place (3), finger direction (3) and palm direction (3), all
already multiplied by the weight, in the axes of the held thing. The weights of an arm sum to at
most one; the rest belongs to the joint angles above. After a hold of each thing comes the one that
a hand is letting go of, of each thing again."""
HOLD_SIZE: Final = 10
CHEST: Final = 0
HEAD: Final = 1
THIGH: Final = 2
PELVIS: Final = 3
HOLDS: Final = 4

SMILE: Final = ARM + 2 * ARM_SIZE
JAW: Final = SMILE + 1
FRONT: Final = JAW + 1
"""Where the body belongs to, left of −z; gaze that wanders stays about it."""
ATTEND: Final = FRONT + 1
"""1 where the activity has an object of its own to look at, then its yaw and pitch from `FRONT`."""
SIZE: Final = ATTEND + 3

# Rows of the canonical skeleton: nine joints of the trunk, then 23 of each side.
JOINTS: Final = 55
J_HIPS: Final = 0
J_SPINE: Final = 1
J_CHEST: Final = 2
J_UPPER_CHEST: Final = 3
J_NECK: Final = 4
J_HEAD: Final = 5
J_JAW: Final = 6
J_LEFT_EYE: Final = 7
J_RIGHT_EYE: Final = 8
J_SIDE: Final = 9
"""First joint of the left side; the right side follows after `SIDE_SIZE`."""
SIDE_SIZE: Final = 23
S_SHOULDER: Final = 0
S_UPPER_ARM: Final = 1
S_LOWER_ARM: Final = 2
S_HAND: Final = 3
S_THUMB: Final = 4
S_FINGERS: Final = 7
S_UPPER_LEG: Final = 19
S_LOWER_LEG: Final = 20
S_FOOT: Final = 21
S_TOES: Final = 22

# Columns of a build: the lengths a posture is planned with.
B_LEG: Final = 0
"""Thigh and shin."""
B_THIGH: Final = 1
B_SHIN: Final = 2
B_STAND: Final = 3
"""Hips above the floor on straight legs."""
B_ANKLE: Final = 4
"""Ankle joint above the floor."""
B_HIP_X: Final = 5
"""Half the distance of the hip joints."""
B_HIP_Y: Final = 6
"""Hip joints below the hips."""
B_UPPER_ARM: Final = 7
B_FOREARM: Final = 8
B_HAND: Final = 9
"""Wrist to knuckle of the middle finger."""
B_SHOULDER_X: Final = 10
"""Half the distance of the shoulder joints."""
B_TRUNK: Final = 11
"""Hips to upper chest."""
B_STATURE: Final = 12
B_SEAT_GAP: Final = 13
"""Hips above the seat when sitting on it."""
B_THIGH_RADIUS: Final = 14
B_BELLY: Final = 15
"""Front of the trunk before its joints."""
B_HEAD_HALF: Final = 16
"""Half the width of the head at the ears."""
B_FOOT: Final = 17
"""Ankle to ball of the foot, along the floor."""
B_SHOULDER_Y: Final = 18
"""Shoulder joints above the upper chest."""
B_SHOULDER_Z: Final = 19
B_EAR_Y: Final = 20
"""Ears above the head joint."""
B_HEEL: Final = 21
"""Back of the heel behind the ankle."""
B_BALL_Y: Final = 22
"""Joint of the toes above the floor on flat feet."""
B_KNEE_GAP: Final = 23
"""Knees above the seat when sitting on it."""
B_AT_EAR: Final = 24
"""A left hand with a telephone at the ear, in the head's axes: wrist, ways of fingers and palm."""
B_HAND_THICK: Final = 33
"""Palm to back, about the knuckles."""
B_ELBOW_BESIDE: Final = 34
"""Elbow from the middle of the trunk where the arm hangs just clear of it."""
B_GRIP: Final = 35
"""Fingers about a telephone: curls and knuckles (4 each), spread; thumb: bent, opposed, in."""
GRIP_SIZE: Final = 12
B_SIZE: Final = B_GRIP + GRIP_SIZE
