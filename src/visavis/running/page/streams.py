"""Streams of samples that a page sends among its numbered events: what it sends, and what is
written.

A page in a headset sends what its devices measure as events of the kind `stream`, numbered in the
same sequence as its replies: a reply is acknowledged once all samples before it are on the disk.
Everything here is the wire between `site/` and the server.

**A batch** is one event of `POST /api/events`, about every half second, at most `MAX_ROWS` rows::

    {"n": 17, "kind": "stream", "at_ms": 81234.5, "stream": "head", "seq0": 5400, "rows": 45,
     "t0_ms": 80730.2, "data": "…"}

- `n`, `at_ms`: as of every event; the number in the common sequence, and the page's clock
  (`performance.now()`) when the batch was closed.
- `seq0`: number of the first row; rows of a batch follow one another without a hole. A hole
  between `seq0 + rows` of one batch and `seq0` of the next is samples that were lost, and a page
  that knows of a lost frame closes its batch there. Numbers never go back, also not after a
  reload: the answer to `/api/hello` has `"streams": {"head": 5445, …}`, the next number of each
  stream that has any; a page goes on from there, or from the end of what waits in its own store
  if that is later.
- `t0_ms`: the page's clock at the first row. `data`: float32, little-endian, row after row,
  base64 without line breaks; the first column of every stream is milliseconds since `t0_ms`,
  never falling. What is not known is NaN, and `valid` then 0. Where `rows` and the length of
  `data` disagree the event is refused.
- `rate_hz`: how often the headset draws a second, null where its browser does not say.
- `tab`: the page by whose clock it is dated, as in `/api/hello`; what waits in a page's store may
  be of an earlier one, whose clock began elsewhere.

**Streams and their columns** (`COLUMNS`), each written into the stream that a laboratory's
devices write (units m, unit quaternions w x y z, y up, −z forward, `local-floor`):

- `head`: ms, x y z, w x y z, valid. One row a frame of the headset; `seq0` + row is the number of
  the frame. The pose of the viewer as predicted for this frame. Of up to 8 frames that were left
  out together each is a row of which nothing is known; more are a hole in the numbers.
- `frame_timing`: ms, xr_ms, predicted_ms, own_ms, skipped, drawn. One row a frame, the same
  numbers as `head`. `xr_ms` is the time that the frame's callback was given, `predicted_ms` is
  `predictedDisplayTime` (NaN where there is none), both since `xr0_ms` of the event (a double
  beside `t0_ms`; the clock of the headset's browser, taken for no other); `own_ms` from the
  callback's beginning to its end, NaN for a frame that was left out; `skipped` how many frames
  the display went on without before it, by gaps of XR time; `drawn` 1 if the page drew something.
- `pointer`: ms, hand, x y z, w x y z, valid. One row a frame and hand; hand 0 left, 1 right. Rays
  run along −z.
- `responses`: ms, control, value_01. `control` is an index into `CONTROLS`; 1 at `selectstart`, 0
  at `selectend` (never `select`), axes of a thumbstick −1 to 1.
- `hands`: ms, then for each of the 50 joints of `HAND_JOINTS` (left hand first, order of the
  standard) x y z w x y z valid. At most 30 rows a second.

**Happenings of a headset** are events of the kind `xr`: `{"n", "kind": "xr", "at_ms", "what": …,
"detail": "short text"}`; `what` is a name of `HAPPENINGS`, whose value flags the trial ("" flags
nothing). With `reset` a new epoch of the head begins: poses before and after have no common
origin.

**Entering.** A study with `xr="optional"` or `"required"` has a step `{"kind": "enter", "xr":
"optional"|"required", "needs": [] | ["hands"], "lines": ["what people are told", …], "version":
"…"}` after consent and preloading: a click must start VR. Its reply is `{"entered": true,
"rate_hz": 90.0 | null, "space": "local-floor", "controllers": ["left", "right"], "renderer": "…",
"profiles": ["oculus-touch-v3", …]}` or `{"entered": false, "why": "short text"}`; the second is
refused where VR is required (the person can stop instead). `hello` answers with `"xr"` unless it
is never.

**Clock.** Every post of events may have `"post": 31` (a count of the page's posts, a new number
also when something is sent again) beside `sent_ms`, and `"heard": [[30, 81230.1], …]`: the
numbers of earlier posts and the page's clock when their answers came (at most 64). With the
server's two stamps of that post, which it keeps, these are the four stamps of an exchange; see
`visavis.recording.page_clock`.

**Too long.** A post of more than 1 MiB is answered by 413 and `{"refused": "…", "max_bytes":
262144}`; the page sends less at once, and sets a single event aside that is too long alone.
"""

from collections.abc import Mapping
from typing import Final

MAX_ROWS: Final = 2048
"""Most rows of one batch, and of one call of the recorder."""
MAX_RATE_HZ: Final = 1000.0
"""More often no headset draws."""
POST_BYTES: Final = 256 * 1024
"""Most bytes of events that a page puts into one post."""
_POSE: Final = ("x", "y", "z", "qw", "qx", "qy", "qz")
_JOINTS: Final = (
    "wrist",
    *(f"thumb_{part}" for part in ("metacarpal", "proximal", "distal", "tip")),
    *(
        f"{finger}_{part}"
        for finger in ("index", "middle", "ring", "little")
        for part in ("metacarpal", "proximal", "intermediate", "distal", "tip")
    ),
)
HAND_JOINTS: Final = tuple(f"{side}_{joint}" for side in ("left", "right") for joint in _JOINTS)
"""Joints of both hands in the order of WebXR Hand Input."""
CONTROLS: Final = tuple(
    f"{side}_{name}"
    for side in ("left", "right")
    for name in ("trigger", "squeeze", "stick_x", "stick_y", "stick", "lower", "upper")
)
"""Controls of controllers by index: `trigger` is what `selectstart` tells, `lower` and `upper` are
the two buttons (X and Y, A and B)."""
COLUMNS: Final[Mapping[str, tuple[str, ...]]] = {
    "head": ("ms", *_POSE, "valid"),
    "frame_timing": ("ms", "xr_ms", "predicted_ms", "own_ms", "skipped", "drawn"),
    "pointer": ("ms", "hand", *_POSE, "valid"),
    "responses": ("ms", "control", "value_01"),
    "hands": ("ms", *(f"{j}_{c}" for j in HAND_JOINTS for c in (*_POSE, "valid"))),
}
"""Columns of each stream on the wire."""
HAPPENINGS: Final[Mapping[str, str]] = {
    "entered": "",
    "ended": "VR ended",
    "visible": "",
    "blurred": "headset paused",
    "hidden": "headset paused",
    "off": "headset off",
    "on": "",
    "reset": "reference space reset",
    "controllers_asleep": "controllers asleep",
    "controllers_awake": "",
    "hands": "",
    "context_lost": "graphics lost",
    "battery_low": "battery low",
}
"""What happens around a headset, and the flag of the trial in which it does."""
