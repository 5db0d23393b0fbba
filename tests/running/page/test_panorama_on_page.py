"""Panoramas on a page without a browser: turns of simulated people, forged replies, measures."""

import io
import json
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image as Files

from tests.running.page.test_flat_on_page import request_of
from visavis.cli.film.on_page import page_pictures
from visavis.lab.clock import NS_PER_MS
from visavis.lab.errors import DesignError
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import Mark
from visavis.recording.cached import CachedRecording
from visavis.running.film_store import film_store
from visavis.running.page.flat import view_turns
from visavis.running.page.other_hosts.bundle import files_of, steps_of_place
from visavis.running.page.perform import perform_new
from visavis.running.page.replies import check_reply
from visavis.running.page.server import FILES, SITE
from visavis.running.page.steps import PageError, PageStep, Reply
from visavis.running.page.trial import perform_on_page
from visavis.running.picture_store import PictureStore
from visavis.stimuli.flat import Panorama
from visavis.stimuli.view_turns import ARROWS, VIEW_TURNED, ViewTurns
from visavis.study.information import facts_in_event, information_on_page
from visavis.study.measures import TrialRecord
from visavis.study.trial import TrialScript

HEAD = """
from visavis import Factor, Keys, Panorama, Rating, Shape, Study, Text, view_range

DISC = Shape("ellipse", 1, colour="#00ff00")

study = Study("flats", factors=[Factor("side", [0, 150])], on="browser", uses=(),
              calibrate=False, repetitions=2, measures=[view_range()])

@study.trial
def trial(t):
"""
STUDY = (
    HEAD
    + """
    yield t.show([Panorama("a.png", yaw_deg=t.side, areas="a.yaml"), DISC], 12)
    yield t.wait(1)
    yield t.ask(Rating("calm", 1, 5))
    yield t.show(Panorama("a.png"), until=Keys("f", "j"), limit_s=2)
"""
)
AREAS = "door: {rectangle: [-15, 15, 30, 30]}\nlamp: {ellipse: [180, 0, 30, 30], salience: 9}\n"
BESIDE_DEG = 1.0
"""How far 40 pixels of a simulated page are from its middle."""
SCREEN = {"px_per_mm": 4.0, "distance_mm": 600.0}


def directions_picture(path: Path, wide: int = 2048) -> None:
    """Save a panorama whose red is the direction to the right, whose green that upwards."""
    red, green = np.meshgrid(np.linspace(0, 255, wide), np.linspace(255, 0, wide // 2))
    pixels = np.stack([red, green, np.full_like(red, 99)], axis=2)
    Files.fromarray(pixels.round().astype(np.uint8)).save(path)


def direction_of(pixel: Any) -> tuple[float, float]:
    """Return the direction that a pixel of it is, in degrees."""
    red, green, blue = (int(v) for v in pixel[:3])
    assert abs(blue - 99) <= 1, pixel
    return (red / 255 - 0.5) * 360, (green / 255 - 0.5) * 180


def request(folder: Path, text: str = STUDY) -> Any:
    directions_picture(folder / "a.png")
    (folder / "a.yaml").write_text(AREAS, "utf-8")
    return request_of(text, folder)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Any:
    session_request = request(tmp_path_factory.mktemp("around"))
    return session_request, CachedRecording(perform_new(session_request))


def turns_of(recording: CachedRecording, row: Any, name: str = "stimulus") -> list[Any]:
    turns = recording.events_named(VIEW_TURNED, 1)["payload"]
    return [p for p in turns if (p["trial_id"], p["name"]) == (row["trial_id"], name)]


def test_simulated_people_turn_the_view_and_are_measured_from_the_recording(session: Any) -> None:
    session_request, recording = session
    rows = session_request.study.measure(recording).rows
    lasts_s = (rows["stimulus_off_ns"] - rows["stimulus_on_ns"]) / 1e9
    assert lasts_s.to_numpy() == pytest.approx(13.0, abs=0.02)
    assert rows["view_range_deg"].between(30, 360).all()
    for row in rows.to_dict("records"):
        mine = turns_of(recording, row)
        assert len(mine) > 1
        seen_deg = [0.0, *(p["yaw_deg"] for p in mine)]  # where each turn began
        goals_deg = [0.0, *(p["to_yaw_deg"] for p in mine)]
        assert np.ptp(seen_deg) <= row["view_range_deg"] + 0.01
        assert row["view_range_deg"] <= min(360, np.ptp(goals_deg)) + 0.01
        times_ns = [p["changed_ns"] for p in mine]
        assert row["stimulus_on_ns"] < min(times_ns) <= max(times_ns) < row["stimulus_off_ns"]
    lines = information_on_page(session_request.experiment, ()).lines
    assert any("arrow keys" in line for line in lines)
    events = recording.events()[["name", "payload"]].itertuples(index=False)
    facts = frozenset().union(*(facts_in_event(name, payload) for name, payload in events))
    assert {"turning", "flats", "distance"} <= facts


def test_a_film_of_the_trial_shows_the_direction_in_which_the_view_was(session: Any) -> None:
    session_request, recording = session
    rows = recording.trials()
    row = rows[rows["side"] == 0].iloc[0]
    turns = turns_of(recording, row)
    times_ns = [int(row["stimulus_on_ns"]) + 10**8]
    goals = [(0.0, 0.0)]
    for turn, later_ns in zip(
        turns, [*(t["changed_ns"] for t in turns[1:]), int(row["stimulus_off_ns"])], strict=True
    ):
        if later_ns - turn["changed_ns"] > 10**9:  # it has come to its goal by then
            times_ns.append(later_ns - 10**8)
            goals.append((turn["to_yaw_deg"], turn["to_pitch_deg"]))
    assert len(goals) > 1
    size_px = (640, 400)
    pictures = page_pictures(
        session_request.study,
        recording,
        str(row["trial_id"]),
        lambda start_ns, end_ns: times_ns,
        size_px,
    )
    for (_, image, _), (right_deg, up_deg) in zip(pictures, goals, strict=True):
        assert (0, 255, 0) == tuple(image[200, 320])  # the disc in the middle, of a degree
        seen_deg = direction_of(image[200, 300])
        expected = ((right_deg - BESIDE_DEG + 180) % 360 - 180, up_deg)
        assert expected == pytest.approx(seen_deg, abs=1.6)


def trial_of(folder: Path, text: str = STUDY) -> tuple[Any, TrialScript, Any, PageStep]:
    session_request = request(folder, text)
    script = TrialScript(
        Trial("T1", 1, 0, False, {"side": 150}, 1), session_request.experiment.settings
    )
    performing = perform_on_page(script, session_request.study.study.trial_plan, lambda image: {})
    step = next(performing)
    assert isinstance(step, PageStep)
    return session_request, script, performing, step


def reply_of(first: Any, second: Any = (), **more: Any) -> dict[str, Any]:
    part = {"frames": 60, "dropped": 0}
    return {
        "shown_ms": 900.0,
        "hidden_ms": 0.0,
        "parts": [
            part | {"on_ms": 1000.0, "off_ms": 9000.0, "turns": first},
            part | {"on_ms": 9000.0, "off_ms": 10000.0, "turns": list(second)},
        ],
        "screen": SCREEN,
        "outside": 0,
        "answer": None,
        "view_px": [1200, 800],
        "frame_ms": 16.0,
        **more,
    }


RIGHT = [2000.0, [0, 0], [30, 0]]


def test_how_much_was_ahead_follows_from_the_turns_that_a_page_reports(tmp_path: Path) -> None:
    session_request, script, performing, step = trial_of(tmp_path)
    first, second = step.content["parts"]
    assert (150, "a.png") == (first["panorama"]["yaw_deg"], first["panorama"]["file"])
    assert second["goes_on"]
    assert first["panorama"] == second["panorama"]
    # to the right; back, a third of the way on; while the trial waits, up
    rows = [RIGHT, [3000.0, [30, 0], [0, 0]], [3112.0, [19.92, 0], [-30, 0]]]
    content = reply_of(rows, [[9500.0, [-30, 0], [-30, 30]]])
    check_reply(step, content)
    reply = Reply(content, 0, lambda ms: round(ms * 1e6))
    events = []
    out = performing.send(reply)
    while isinstance(out, Mark):
        events.append((out.name, out.payload))
        out = performing.send(None)
    assert ["shown", *[VIEW_TURNED] * 4] == [name for name, _ in events]
    payload = events[0][1]
    assert (
        "Panorama(file='a.png', stereo='none', yaw_deg=150, areas='a.yaml')"
        == payload["option_panorama"]
    )
    assert {"stimulus"} == {payload["name"] for _, payload in events}
    last = events[-1][1]
    assert (9_500_000_000, 16_000_000) == (last["changed_ns"], last["frame_ns"])
    assert (-30, 30) == (last["to_yaw_deg"], last["to_pitch_deg"])
    recording: Any = SimpleNamespace(
        manifest=SimpleNamespace(configuration={"on": "browser"}),
        events_named=lambda name, part: {"payload": [p for n, p in events if n == name]},
    )
    record = TrialRecord({**script.row, "trial_id": "T1", "recording_part": 1}, recording)
    (measure,) = session_request.study.study.analysis.measures
    assert measure.of is not None
    assert pytest.approx(60.0, abs=0.2) == measure.of(record)


def test_the_script_of_a_page_turns_the_view_by_the_rule_of_monitors() -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs the Debian package nodejs")
    rng = np.random.default_rng(5)
    frames = np.sort(np.repeat(rng.choice(900, 30, replace=False), 2))  # two in a frame
    frames[2::4] += 1  # and a third before the next
    arrows = rng.choice(sorted(ARROWS), len(frames)).tolist()
    frame_ms = 16.0
    keys = [[f"arrow{arrow}", frame_ms * k] for arrow, k in zip(arrows, frames, strict=True)]
    at_ms = (np.arange(0, 1200, 7) * frame_ms).tolist()
    script = (
        f'import {{ viewTurns }} from "{(SITE / "panorama.js").as_uri()}";'
        f"const view = viewTurns({frame_ms});"
        f"const rows = {json.dumps(keys)}.map(([name, ms]) => view.press(name, ms));"
        f"console.log(JSON.stringify([rows, {json.dumps(at_ms)}.map(view.at)]));"
    )
    process = subprocess.run(
        [node, "--input-type=module", "-e", script],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    rows, directions_deg = json.loads(process.stdout)
    turns = ViewTurns(round(frame_ms * NS_PER_MS))
    for (_, ms), arrow, row in zip(keys, arrows, rows, strict=True):
        assert turns.press(arrow, round(ms * NS_PER_MS)) == (row is not None)
        if row is not None:
            assert turns.turns[-1].to_deg == tuple(row[2])
            assert turns.turns[-1].from_deg == pytest.approx(row[1], abs=1e-9)
    course_deg = turns.course((np.array(at_ms) * NS_PER_MS).astype(np.int64))
    np.testing.assert_allclose(directions_deg, course_deg, atol=1e-9)
    assert None in rows  # up and down it does not go further


FORGERIES = [
    (reply_of(None), "a list of"),
    (reply_of([[2000.0, [0, 0]]]), "rows of ms, from and to"),
    (reply_of([[2000.0, [0, 0], [30]]]), "to the right and upwards"),
    (reply_of([["a", [0, 0], [30, 0]]]), "not a number"),
    (reply_of([RIGHT] * 5001), "a list of"),
    (reply_of([[2000.0, [0, 0], [31, 0]]]), "no key turns a view"),
    (reply_of([[2000.0, [0, 0], [0, 0]]]), "no key turns a view"),
    (reply_of([[2000.0, [0, 0], [30, 30]]]), "no key turns a view"),
    (reply_of([[2000.0, [1, 0], [30, 0]]]), "was not on its way"),
    (reply_of([RIGHT, [3000.0, [31, 0], [60, 0]]]), "was not on its way"),
    (reply_of([RIGHT, [1990.0, [10, 0], [60, 0]]]), "when it was not seen"),
    (reply_of([[999.0, [0, 0], [30, 0]]]), "when it was not seen"),
    (reply_of([[9001.0, [0, 0], [30, 0]]]), "when it was not seen"),
    (reply_of([RIGHT], [[9500.0, [0, 0], [30, 0]]]), "no key turns a view"),
    (reply_of([RIGHT], frame_ms=0), "frame_ms"),
    (reply_of([RIGHT], frame_ms=None), "frame_ms"),
    (reply_of([RIGHT], frame_ms=1001), "frame_ms"),
    (reply_of([RIGHT], view_px=None), "view_px"),
]


@pytest.mark.parametrize(("content", "says"), FORGERIES, ids=range(len(FORGERIES)))
def test_a_forged_turn_is_refused(content: Any, says: str, tmp_path: Path) -> None:
    step = trial_of(tmp_path)[3]
    check_reply(step, reply_of([RIGHT], [[9000.0, [30, 0], [60, 0]]]))
    with pytest.raises(PageError, match=says):
        check_reply(step, content)


def test_a_view_turns_up_to_sixty_degrees_and_no_further(tmp_path: Path) -> None:
    step = trial_of(tmp_path)[3]
    up = [[2000.0, [0, 0], [0, 30]], [3000.0, [0, 30], [0, 60]]]
    check_reply(step, reply_of(up))
    with pytest.raises(PageError, match="no key turns a view"):
        check_reply(step, reply_of([*up, [4000.0, [0, 60], [0, 90]]]))


def test_only_a_panorama_turns(tmp_path: Path) -> None:
    step = trial_of(tmp_path, HEAD + '    yield t.show(Text("+"), 1)\n')[3]
    with pytest.raises(PageError, match="only the view onto a panorama turns"):
        check_reply(step, {**reply_of([]), "parts": reply_of([])["parts"][:1]})


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ('Panorama("a.png"), 2, reveal="pointer"', "the view onto a Panorama move"),
        ('Panorama("a.png"), until=Keys("left", "f")', "left: arrow keys turn the view"),
    ],
)
def test_what_no_page_shows_around_is_refused_by_name(tmp_path: Path, line: str, says: str) -> None:
    with pytest.raises(DesignError, match=says):
        film_store(request(tmp_path, HEAD + f"    yield t.show({line})\n").experiment)


def test_a_page_in_a_headset_refuses_a_panorama_by_name(tmp_path: Path) -> None:
    text = STUDY.replace('on="browser"', 'on="browser", xr="optional"')
    with pytest.raises(DesignError, match=r"it shows a Panorama, .* leave xr out"):
        film_store(request(tmp_path, text).experiment)


def test_a_bundle_has_each_panorama_once_and_the_script_that_draws_it(tmp_path: Path) -> None:
    session_request = request(tmp_path)
    store = film_store(session_request.experiment)
    steps = steps_of_place(session_request, store, 0)
    (preload,) = (step for step in steps if step.kind == "preload")
    names = [picture["picture"] for picture in preload.content["pictures"]]
    assert [*files_of(store, session_request.experiment)[1]] == [*dict.fromkeys(names)]
    assert "card" in [step.kind for step in steps]
    worker = (SITE / "bundle" / "worker.js").read_text("utf-8")
    assert "panorama.js" in FILES.values()
    assert '"panorama.js"' in worker


def test_a_page_gets_what_the_left_eye_sees_at_most_4096_pixels_wide(tmp_path: Path) -> None:
    left, right = np.full((2100, 4200, 3), 200, np.uint8), np.zeros((2100, 4200, 3), np.uint8)
    Files.fromarray(np.concatenate([left, right])).save(tmp_path / "two.png")
    Files.fromarray(left[:1024, :2048]).save(tmp_path / "one.jpg")
    store = PictureStore((), tmp_path)
    about = store.describe(Panorama("two.png", "top-bottom"))
    assert (4096, 2048) == (about["width_px"], about["height_px"])
    photograph = store.describe(Panorama("one.jpg"))
    assert ("image/jpeg", 2048) == (photograph["mime"], photograph["width_px"])
    for one, size_px in ((about, (4096, 2048)), (photograph, (2048, 1024))):
        picture = Files.open(io.BytesIO(store.assets[one["picture"]]))
        assert size_px == picture.size
        assert (200, 200, 200) == picture.convert("RGB").getpixel((5, 5))


def test_a_frame_of_a_turning_view_lasts_as_long_as_the_page_says() -> None:
    reply = Reply({"frame_ms": 20.0}, 0, lambda at_ms: round(at_ms * NS_PER_MS))
    assert 20 * NS_PER_MS == view_turns([], reply).frame_ns
