"""BVH files: exact round trips, any channel order, and a named line for every fault."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.stimuli.motion.motions import SMALL_BVH, random_clip
from tests.stimuli.motion.rotation_cases import same, seeds
from visavis.lab.errors import UsageError
from visavis.stimuli.motion.bvh import (
    CHANNELS,
    Bvh,
    BvhJoint,
    format_bvh,
    parse_bvh,
    read_bvh,
    write_bvh,
)
from visavis.stimuli.motion.bvh_clip import bvh_of_clip, clip_of_bvh
from visavis.stimuli.motion.clip import placed_joints
from visavis.stimuli.motion.errors import BvhError, MotionError

quick = settings(max_examples=25, deadline=None)
NUMBERS = st.floats(-1e6, 1e6)


def random_bvh(rng: np.random.Generator, n_joints: int, n_frames: int) -> Bvh:
    """Return a file with random nesting and any channels in any order; the root has all six."""
    joints: list[BvhJoint] = []
    above: list[int] = []
    for i in range(n_joints):
        while len(above) > 1 and rng.random() < 0.4:
            above.pop()
        count = 6 if i == 0 else int(rng.integers(0, 7))
        channels = tuple(str(c) for c in rng.permutation(CHANNELS)[:count])
        x, y, z = rng.normal(0, 10, 3).tolist()
        end = (z, x, y) if rng.random() < 0.3 else None
        joints.append(BvhJoint(f"joint {i}", above[-1] if above else -1, (x, y, z), channels, end))
        above.append(i)
    n = sum(len(j.channels) for j in joints)
    return Bvh(tuple(joints), float(rng.uniform(0.001, 0.1)), rng.normal(0, 90, (n_frames, n)))


@quick
@given(seeds, st.integers(1, 9), st.integers(1, 5))
def test_written_file_reads_back_the_same_numbers(seed: int, n: int, frames: int) -> None:
    bvh = random_bvh(np.random.default_rng(seed), n, frames)

    again = parse_bvh(format_bvh(bvh))

    assert bvh.joints == again.joints
    assert bvh.frame_time_s == again.frame_time_s
    assert np.array_equal(bvh.values, again.values)


@quick
@given(seeds, st.integers(0, 7))
def test_printed_digits_are_kept_and_written_again_the_same(seed: int, decimals: int) -> None:
    bvh = random_bvh(np.random.default_rng(seed), 5, 3)

    text = format_bvh(bvh, decimals=decimals)
    again = parse_bvh(text)

    assert text == format_bvh(again, decimals=decimals)
    printed = [[round(v, decimals) for v in row] for row in bvh.values.tolist()]
    assert np.array_equal(printed, again.values)


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.replace("\n", "\r\n"),
        lambda t: "\ufeff" + t,
        lambda t: t.replace(" {", "{").replace("\n\t{", " {").replace("\n{", " {"),
        lambda t: t.upper().replace("HIPS", "Hips").replace("CHEST", "Chest").replace("LEG", "Leg"),
        lambda t: t.replace(" 1 2 3 4\n", "\n1 2\n3 4\n"),
        lambda t: t + "\n\n",
        lambda t: t.replace("\t", " ").replace("Frame Time:", "\nFrame  Time: "),
        lambda t: t.replace("End Site", "End Site Chest"),
    ],
    ids=["crlf", "bom", "braces", "case", "wrapped", "blank lines", "spaces", "named end"],
)
def test_habits_of_other_programs_do_not_matter(change: object, tmp_path: Path) -> None:
    expected = parse_bvh(SMALL_BVH)
    path = tmp_path / "mouvement été.bvh"
    path.write_bytes(change(SMALL_BVH).encode())  # type: ignore[operator]  # a lambda above

    got = read_bvh(path)

    assert expected.joints == got.joints
    assert np.array_equal(expected.values, got.values)
    assert 0.0083333 == got.frame_time_s


def broken(old: str, new: str) -> str:
    assert old in SMALL_BVH
    return SMALL_BVH.replace(old, new, 1)


FAULTS = {
    "empty": ("", 1, "empty"),
    "blank": (" \n\n", 1, "empty"),
    "not BVH": ("a,b\n1,2\n", 1, "HIERARCHY"),
    "cut in the hierarchy": (SMALL_BVH[:200], 11, "ends where"),
    "cut before the motion": (SMALL_BVH[: SMALL_BVH.index("MOTION")], 20, "ends where MOTION"),
    "cut before the frame time": (SMALL_BVH[: SMALL_BVH.index("Frame Time")], 22, "frame time"),
    "cut between frames": (SMALL_BVH[: SMALL_BVH.index("1.5 91")], 24, "1 frames in the file"),
    "cut in a frame": (SMALL_BVH[:-10], 25, "values in a frame of 10"),
    "no values": (SMALL_BVH[: SMALL_BVH.index("1 90 3")], 23, "0 frames in the file, 2"),
    "too many frames": (SMALL_BVH + "1 90 3 10 20 30 1 2 3 4\n", 26, "3 frames in the file"),
    "duplicate joint": (broken("JOINT Leg", "JOINT Chest"), 15, "first in line 6"),
    "second root": (broken("MOTION", "ROOT Other"), 21, "second ROOT"),
    "nameless joint": (broken("JOINT Leg", "JOINT"), 15, "no name"),
    "nan": (broken("-20 -30", "nan -30"), 25, "value 5 is 'nan'"),
    "infinity": (broken("1 90 3", "1 inf 3"), 24, "value 2 is 'inf'"),
    "decimal comma": (broken("1.5 91", "1,5 91"), 25, "decimal point"),
    "underscore": (broken("1.5 91", "1_5 91"), 25, "value 1"),
    "unknown channel": (broken("CHANNELS 1 Xrotation", "CHANNELS 1 Wrotation"), 18, "Wrotation"),
    "channel twice": (broken("Yrotation Xrotation Z", "Yrotation Yrotation Z"), 9, "twice"),
    "too few channels": (broken("CHANNELS 6", "CHANNELS 5"), 5, "JOINT, End Site"),
    "too many channels": (broken("CHANNELS 3", "CHANNELS 4"), 10, "unknown channel 'End'"),
    "channels not counted": (broken("CHANNELS 3", "CHANNELS many"), 9, "0 to 6"),
    "offset": (broken("0 10.5 0", "0 ten 0"), 8, "'ten'"),
    "offset nan": (broken("0 10.5 0", "0 nan 0"), 8, "'nan'"),
    "offset short": (broken("0 10.5 0", "0 10.5"), 9, "'CHANNELS'"),
    "two end sites": (
        broken("\t\t}\n\t}\n\tJOINT Leg", "\t\t}\n\tEnd Site { OFFSET 0 0 0 }\n}\n\tJOINT Leg"),
        14,
        "two End Sites",
    ),
    "no frames": (broken("Frames: 2", "Frames: 0"), 22, "no frames"),
    "frames not counted": (broken("Frames: 2", "Frames: two"), 22, "'two' frames"),
    "frames absurd": (broken("Frames: 2", "Frames: " + "9" * 5000), 22, "frames announced"),
    "frame time zero": (broken(".0083333", "0"), 23, "frame time '0'"),
    "frame time nan": (broken(".0083333", "nan"), 23, "frame time 'nan'"),
    "brace missing": (broken("Hips\n{", "Hips\n"), 4, "'OFFSET' instead of {"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_broken_file_is_named_with_its_line(fault: str) -> None:
    text, line, says = FAULTS[fault]

    with pytest.raises(BvhError) as caught:
        parse_bvh(text, "walk.bvh")

    assert line == caught.value.line
    assert f"walk.bvh line {line}: " in str(caught.value)
    assert says in str(caught.value)


@settings(max_examples=150, deadline=None)
@given(st.integers(0, len(SMALL_BVH)), st.text("{}\n 1.aJOINTEndOFFSET", max_size=6))
def test_any_damage_reads_or_is_refused_with_a_line(at: int, put: str) -> None:
    text = SMALL_BVH[:at] + put + SMALL_BVH[at + len(put) :]
    line, finite = 1, True

    try:
        finite = bool(np.isfinite(parse_bvh(text).values).all())
    except BvhError as error:
        line = error.line

    assert finite
    assert 1 <= line <= text.count("\n") + 1


@quick
@given(st.integers(0, len(SMALL_BVH) - 11))
def test_file_cut_anywhere_is_refused(end: int) -> None:
    with pytest.raises(BvhError):
        parse_bvh(SMALL_BVH[:end])


def test_file_that_is_no_text_or_not_there_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "clip.bvh"
    path.write_bytes(b"HIERARCHY\nROOT \xff\xfe\n")

    with pytest.raises(BvhError, match="line 2: is not text"):
        read_bvh(path)
    with pytest.raises(UsageError, match=r"there is no file .*none\.bvh"):
        read_bvh(tmp_path / "none.bvh")


def test_file_is_written_once(tmp_path: Path) -> None:
    bvh = parse_bvh(SMALL_BVH)

    write_bvh(tmp_path / "a.bvh", bvh)

    assert np.array_equal(bvh.values, read_bvh(tmp_path / "a.bvh").values)
    with pytest.raises(MotionError, match="choose another name"):
        write_bvh(tmp_path / "a.bvh", bvh)


def test_joints_out_of_file_order_are_not_written() -> None:
    joints = parse_bvh(SMALL_BVH).joints
    astray = Bvh(
        (joints[0], joints[1], joints[2], BvhJoint("x", 1, (0, 0, 0), ())), 0.1, np.ones((1, 10))
    )

    with pytest.raises(MotionError, match="file order"):
        format_bvh(astray)


def test_channels_turn_from_left_to_right_in_file_order() -> None:
    clip = clip_of_bvh(parse_bvh(SMALL_BVH), unit_m=0.01)

    expected = [
        Rotation.from_euler(order, angles, degrees=True).as_quat(scalar_first=True)
        for order, angles in (("ZYX", [10, 20, 30]), ("YXZ", [1, 2, 3]), ("X", [4]))
    ]

    assert same(np.stack(expected), clip.orientation_wxyz[0], 1e-12)
    assert np.allclose([0.01, 0.9, 0.03], clip.root_m[0], atol=1e-15)
    assert np.allclose([0.03, -0.01, 0], clip.skeleton.offsets_m[2], atol=1e-15)
    assert np.allclose([0, 0.05, 0], clip.skeleton.tips_m[1], atol=1e-15)
    assert 0.0083333 == clip.frame_s


@quick
@given(seeds, st.sampled_from(["ZXY", "ZYX", "XYZ", "YXZ", "XZY", "YZX"]))
def test_clip_written_as_bvh_moves_the_same(seed: int, order: str) -> None:
    clip = random_clip(np.random.default_rng(seed), 7, 6)

    text = format_bvh(bvh_of_clip(clip, unit_m=0.0254, order=order), decimals=9)
    again = clip_of_bvh(parse_bvh(text), unit_m=0.0254)

    names = again.skeleton.names
    place = [names.index(n) for n in clip.skeleton.names]
    expected = placed_joints(clip, clip.frame_times_s).position_m
    got = placed_joints(again, clip.frame_times_s).position_m[:, place]
    assert np.abs(expected - got).max() < 1e-7


def test_angles_written_do_not_jump() -> None:
    clip = random_clip(np.random.default_rng(1), 2, 400)

    values = bvh_of_clip(clip).values[:, 3:]

    assert np.abs(np.diff(values, axis=0)[:, [0, 2]]).max() <= 180.0


def test_six_channels_on_every_joint_stand_for_the_offset_or_are_added() -> None:
    text = SMALL_BVH.replace("CHANNELS 1 Xrotation", "CHANNELS 2 Yposition Xrotation")
    text = text.replace("1 2 3 4\n", "1 2 3 -1 4\n").replace("-3 -4\n", "-3 -1 -4\n")
    bvh = parse_bvh(text)

    for how, expected in (("replace", -0.01), ("add", -0.02)):
        clip = clip_of_bvh(bvh, unit_m=0.01, positions=how)  # type: ignore[arg-type]  # both are valid
        assert pytest.approx(expected) == clip.skeleton.offsets_m[2, 1]


def test_bones_that_stretch_and_impossible_units_are_refused() -> None:
    text = SMALL_BVH.replace("CHANNELS 1 Xrotation", "CHANNELS 1 Xposition")

    with pytest.raises(MotionError, match=r"'Leg' moves 0\.0\d+ m"):
        clip_of_bvh(parse_bvh(text), unit_m=0.01)
    assert clip_of_bvh(parse_bvh(text), unit_m=0.01, max_stretch_m=0.1)
    with pytest.raises(MotionError, match="unit"):
        clip_of_bvh(parse_bvh(SMALL_BVH), unit_m=0.0)
