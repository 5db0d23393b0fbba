"""Measured luminances: a planted display is found again, and wrong tables are named by row."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from visavis.lab.errors import ConfigError
from visavis.lab.luminance import (
    GREY,
    GUNS,
    LuminanceTable,
    luminance_table,
    read_luminance,
    table_of_entry,
)

SCREEN = "1920 x 1080 px 0.531 x 0.299 m monitor 0"
LEVELS = tuple(min(level, 255) for level in range(0, 257, 32))


def light(level: float, gamma: float = 2.2, black: float = 0.4, span: float = 120.0) -> float:
    return float(black + span * (level / 255) ** gamma)


def table_of(gamma: float = 2.2, black: float = 0.4, span: float = 120.0) -> LuminanceTable:
    rows = [(GREY, level, light(level, gamma, black, span)) for level in LEVELS]
    return luminance_table(rows, SCREEN, "f" * 64)


def file_of(folder: Path, text: str) -> Path:
    path = folder / "ä table.csv"
    path.write_text(text, "utf-8")
    return path


@pytest.mark.parametrize("gamma", [1.0, 1.8, 2.2, 2.6])
@pytest.mark.parametrize("black", [0.0, 0.4, 5.0])
def test_a_planted_display_is_found_again(gamma: float, black: float) -> None:
    fit = table_of(gamma, black).grey.fit
    assert gamma == pytest.approx(fit.gamma, abs=1e-4)
    assert (black, 120.0) == pytest.approx((fit.black_cd_m2, fit.range_cd_m2), abs=0.01)
    assert fit.rms_cd_m2 < fit.largest_cd_m2 < 0.01


def test_a_photometer_off_by_one_percent_moves_gamma_little() -> None:
    rng = np.random.default_rng(3)
    rows = [(GREY, v, light(v) * rng.normal(1.0, 0.01)) for v in LEVELS]
    fit = luminance_table(rows, SCREEN, "").grey.fit
    assert pytest.approx(2.2, abs=0.05) == fit.gamma
    assert 0.2 < fit.largest_cd_m2 < 3.6
    assert fit.worst_level in LEVELS[4:]


def test_shares_of_light_are_drawn_within_half_a_level() -> None:
    shares = np.linspace(0.0, 1.0, 101)
    levels = table_of().rgb_of_shares(shares)[:, 0].astype(float)
    low, high = (light(0) + shares * 120.0 for _ in range(2))
    assert (np.array([light(v - 0.51) for v in levels[1:]]) <= low[1:]).all()
    assert (np.array([light(v + 0.51) for v in levels]) >= high).all()
    assert [0, 255] == [levels[0], levels[-1]]


def test_a_display_that_is_no_power_is_followed_through_its_points() -> None:
    def s_curve(level: float) -> float:
        return 0.5 + 200.0 / (1 + np.exp(-(level - 128) / 30)) + level / 9

    table = luminance_table([(GREY, v, s_curve(v)) for v in LEVELS], SCREEN, "")
    black, white = s_curve(0), s_curve(255)
    shares = [(s_curve(v) - black) / (white - black) for v in LEVELS]
    assert list(LEVELS) == pytest.approx(table.grey.levels_of(shares).tolist())
    assert [s_curve(v) for v in LEVELS] == pytest.approx(table.grey.luminances_of(LEVELS).tolist())


def test_each_gun_gives_its_own_share() -> None:
    gammas = dict(zip(GUNS, (1.8, 2.2, 2.5), strict=True))
    rows = [(GREY, v, light(v)) for v in LEVELS]
    rows += [(gun, v, light(v, g, span=40.0)) for gun, g in gammas.items() for v in LEVELS]
    table = luminance_table(rows, SCREEN, "")
    assert list(gammas.values()) == pytest.approx([c.fit.gamma for c in table.curves[1:]], abs=1e-3)
    half = [round(255 * 0.5 ** (1 / gamma)) for gamma in gammas.values()]
    assert half == table.rgb_of_shares(0.5).tolist()


def test_greys_are_of_light_and_other_colours_stay() -> None:
    table = table_of()
    assert [(0, 0, 0), (186, 186, 186), (255, 255, 255)] == [
        table.rgb_of((v, v, v)) for v in (0, 128, 255)
    ]
    assert (255, 140, 0) == table.rgb_of((255, 140, 0))


def test_contrasts_reach_from_one_level_to_white_before_black() -> None:
    table = table_of()
    assert 120 / 120.8 == pytest.approx(table.greatest_contrast_01)
    assert 2.2 / 186 == pytest.approx(table.least_contrast_01, rel=0.02)
    assert "0.4 to 120.4 cd/m², gamma 2.20, contrasts from 0.012 to 0.993" in table.summary


WRONG = {
    "reversed": (
        "level,cd_m2\n" + "\n".join(f"{v},{light(255 - v)}" for v in LEVELS),
        r"row 3: grey 32 has 89\.\d+ cd/m², not more than 120\.4 of 0 in row 2.*row 10",
    ),
    "flat": (
        "level,cd_m2\n0,0.3\n16,0.3\n64,2\n128,9\n192,40\n255,98\n",
        "row 3: grey 16 has 0.3 cd/m², not more than 0.3 of 0 in row 2",
    ),
    "too few": (
        "level;cd_m2\n0;0,3\n128;23,5\n255;98,2\n",
        "grey has the levels 0, 128, 255; measure 6 or more, 0 and 255 among them",
    ),
    "no white": ("level,cd_m2\n" + "\n".join(f"{v},{v + 1}" for v in range(7)), "0 and 255 among"),
    "no unit": ("level,luminance\n0,1\n255,2\n", "row 1: the column 'luminance' names no unit"),
    "no level": ("cd_m2,at\n0,1\n255,2\n", "row 1: there is no column 'level'"),
    "other screen": (
        f"level,cd_m2,screen\n0,1,{SCREEN}\n255,2,1024 x 768 px\n",
        "row 3: this was measured on another screen, 1024 x 768 px; the configuration's is 1920",
    ),
    "words": ("level,cd_m2\n0,98 cd/m2\n12.5,3\n", "row 2: cd_m2 is '98 cd/m2'.*row 3: the level"),
    "no number": ("level,cd_m2\n0,nan\n5,-1\n", "row 2: cd_m2 is 'nan'.*row 3: cd_m2 is '-1'"),
    "gun": ("level,cd_m2,gun\n0,1,rot\n", "row 2: there is no gun 'rot'; grey, red, green, blue"),
    "one gun": (
        "gun,level,cd_m2\n"
        + "\n".join(f"{g},{v},{light(v)}" for g in ("grey", "red") for v in LEVELS),
        "grey, red is measured; measure grey, and all three guns or none",
    ),
    "twice": (
        "level,cd_m2\n" + "\n".join(f"{v},{light(v)}" for v in (*LEVELS, 255)),
        "row 11: grey 255 stands in row 10 already",
    ),
    "empty": ("", "the file is empty"),
}


@pytest.mark.parametrize(("text", "said"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_with_a_table_is_named_by_row(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"ä table\.csv.*" + said):
        read_luminance(file_of(tmp_path, text), SCREEN)


def test_rows_may_stand_in_any_order_with_decimal_commas(tmp_path: Path) -> None:
    rows = "\n".join(f"{light(v):.4f};{v}".replace(".", ",") for v in reversed(LEVELS))
    table = read_luminance(file_of(tmp_path, f"\ufeffcd_m2;level\n{rows}"), SCREEN)
    assert LEVELS == table.grey.levels
    assert pytest.approx(2.2, abs=0.001) == table.grey.fit.gamma


def test_a_manifest_keeps_the_whole_table() -> None:
    table = table_of()
    assert table == table_of_entry(table.as_entry())
    assert table_of_entry({"sha256": ""}) is None
    assert table_of_entry(None) is None


@pytest.mark.parametrize(
    "entry",
    [
        {"sha256": "f", "screen": SCREEN},
        {"sha256": "f", "rows": [[GREY, 0, 0.4]]},
        {"sha256": "f", "screen": SCREEN, "rows": [[GREY, 0]]},
        {"sha256": "f", "screen": SCREEN, "rows": [[GREY, "dark", 0.4]]},
        {"sha256": "f", "screen": SCREEN, "rows": [[GREY, 0, 0.4]]},
        {"sha256": "f", "screen": SCREEN, "rows": 7},
        "f",
    ],
)
def test_a_damaged_entry_of_a_manifest_is_named(entry: Any) -> None:
    with pytest.raises(ConfigError, match=r"the manifest's entry configuration\.luminance"):
        table_of_entry(entry)
