"""Who is in the default cast: body, face, colours, hair and clothes of each person."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from character_making.shaping import Shape

Colour = tuple[int, int, int]


@dataclass(frozen=True)
class Face:
    """Colours of skin and hair, sRGB 0…255; shares from 0 to 1."""

    skin: Colour
    lips: Colour
    iris: Colour
    hair: Colour
    brow: Colour
    brow_weight: float = 0.6
    flush: float = 0.4
    stubble: float = 0.0
    freckles: float = 0.0
    lines: float = 0.0
    make_up: float = 0.0
    grey: float = 0.0


@dataclass(frozen=True)
class Garment:
    """A piece of clothing; `kind` is known to `clothes`, lengths are described there."""

    kind: str
    colour: Colour
    pattern: str = "plain"
    second: Colour = (240, 240, 240)
    cut: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Recipe:
    """One person of the cast; `stature_m` is without shoes."""

    name: str
    shape: Shape
    stature_m: float
    face: Face
    hair: str
    garments: tuple[Garment, ...]
    shoes: str = "sneaker"
    shoe_colour: Colour = (60, 60, 64)


def _shape(
    gender: str,
    age: float,
    origins: Mapping[str, float],
    details: Mapping[str, float],
    **build: float,
) -> Shape:
    sex: Literal["female", "male"] = "female" if gender == "f" else "male"
    # The base mesh's mouth hangs; with this much lift a face at rest looks neutral.
    at_rest = {"mouth/mouth-angles-up": 0.35, **details}
    return Shape(sex, age, origins=origins, details=at_rest, **build)


CAST: tuple[Recipe, ...] = (
    Recipe(
        "anna",
        _shape("f", 29, {"caucasian": 1.0},
               {"head/head-oval": 0.5, "nose/nose-scale-horiz-decr": 0.4,
                "nose/nose-point-up": 0.3, "mouth/mouth-upperlip-volume-incr": 0.3,
                "eyes/~-eye-scale-incr": 0.25, "cheek/~-cheek-bones-incr": 0.3},
               muscle=-0.1, weight=-0.25, proportions=0.5, cup=-0.1, firmness=0.4),
        1.68,
        Face((212, 170, 148), (182, 106, 98), (60, 92, 118), (106, 72, 44), (84, 58, 38),
             brow_weight=0.55, flush=0.5, freckles=0.5, make_up=0.3),
        "long",
        (Garment("jumper", (58, 96, 122), "knit"), Garment("jeans", (52, 66, 98), "denim")),
        "sneaker", (232, 230, 224),
    ),
    Recipe(
        "bela",
        _shape("f", 58, {"caucasian": 0.9, "asian": 0.1},
               {"head/head-round": 0.5, "nose/nose-hump-incr": 0.3, "nose/nose-volume-incr": 0.3,
                "chin/chin-width-incr": 0.3, "eyes/~-eye-bag-incr": 0.5,
                "neck/neck-double-incr": 0.3, "mouth/mouth-laugh-lines-in": 0.4},
               muscle=-0.3, weight=0.35, proportions=0.0, cup=0.4, firmness=-0.4),
        1.63,
        Face((209, 167, 147), (166, 99, 93), (112, 128, 104), (168, 164, 160), (116, 100, 84),
             brow_weight=0.4, flush=0.6, lines=0.7, grey=0.6),
        "bob",
        (Garment("cardigan", (128, 52, 66), "knit", (232, 226, 214)),
         Garment("trousers", (58, 56, 62), "twill")),
        "loafer", (52, 38, 34),
    ),
    Recipe(
        "chloe",
        _shape("f", 24, {"african": 1.0},
               {"head/head-oval": 0.6, "eyes/~-eye-scale-incr": 0.3,
                "mouth/mouth-scale-horiz-incr": 0.2, "cheek/~-cheek-bones-incr": 0.4,
                "chin/chin-width-decr": 0.3},
               muscle=0.1, weight=-0.15, proportions=0.6, cup=0.0, firmness=0.5),
        1.72,
        Face((112, 72, 52), (128, 66, 62), (58, 36, 22), (26, 20, 18), (24, 18, 16),
             brow_weight=0.7, flush=0.2, make_up=0.2),
        "curly",
        (Garment("shirt", (236, 226, 208), "plain", cut={"placket": False}),
         Garment("chinos", (150, 88, 44), "twill")),
        "loafer", (70, 44, 32),
    ),
    Recipe(
        "dai",
        _shape("f", 36, {"asian": 1.0},
               {"head/head-round": 0.3, "nose/nose-scale-vert-decr": 0.2,
                "mouth/mouth-scale-horiz-decr": 0.2, "chin/chin-width-decr": 0.2},
               muscle=-0.1, weight=-0.2, height=0.0, proportions=0.3, cup=-0.4, firmness=0.3),
        1.60,
        Face((209, 168, 144), (170, 98, 92), (56, 36, 24), (24, 20, 22), (34, 28, 28),
             brow_weight=0.5, flush=0.6, make_up=0.4),
        "bun",
        (Garment("jacket", (42, 46, 60), "twill", (224, 226, 230)),
         Garment("trousers", (42, 46, 60), "twill")),
        "loafer", (28, 26, 28),
    ),
    Recipe(
        "elif",
        _shape("f", 44, {"caucasian": 0.6, "african": 0.2, "asian": 0.2},
               {"head/head-rectangular": 0.3, "nose/nose-scale-vert-incr": 0.3,
                "nose/nose-curve-convex": 0.3, "eyes/~-eye-corner2-up": 0.3,
                "mouth/mouth-lowerlip-volume-incr": 0.3},
               muscle=0.0, weight=0.12, proportions=0.2, cup=0.3, firmness=0.0),
        1.65,
        Face((198, 148, 116), (166, 94, 86), (74, 50, 30), (44, 30, 24), (38, 28, 24),
             brow_weight=0.75, flush=0.3, lines=0.3, make_up=0.4),
        "shoulder",
        (Garment("shirt", (74, 120, 106), "stripe", (228, 236, 230)),
         Garment("jeans", (38, 44, 60), "denim")),
        "sneaker", (64, 70, 84),
    ),
    Recipe(
        "freya",
        _shape("f", 33, {"caucasian": 1.0},
               {"head/head-oval": 0.4, "nose/nose-scale-depth-incr": 0.2,
                "nose/nose-scale-horiz-decr": 0.2, "chin/chin-width-decr": 0.4,
                "mouth/mouth-upperlip-volume-incr": 0.25, "eyes/~-eye-scale-incr": 0.2,
                "cheek/~-cheek-bones-incr": 0.3, "head/head-fat-incr": 0.1},
               muscle=0.3, weight=0.1, proportions=0.1, cup=0.1, firmness=0.2),
        1.76,
        Face((215, 177, 161), (184, 104, 100), (96, 132, 110), (186, 118, 66), (148, 98, 60),
             brow_weight=0.45, flush=0.6, freckles=0.9, make_up=0.35),
        "ponytail",
        (Garment("tee", (196, 84, 72), "plain"), Garment("jeans", (86, 110, 142), "denim")),
        "sneaker", (210, 206, 196),
    ),
    Recipe(
        "gabriel",
        _shape("m", 31, {"caucasian": 1.0},
               {"head/head-rectangular": 0.4, "chin/chin-width-incr": 0.3,
                "nose/nose-scale-vert-incr": 0.2, "forehead/forehead-trans-backward": 0.2},
               muscle=0.25, weight=-0.05, proportions=0.4),
        1.80,
        Face((207, 161, 136), (164, 102, 92), (70, 86, 72), (84, 60, 42), (70, 50, 36),
             brow_weight=0.8, flush=0.45, stubble=0.55),
        "short",
        (Garment("shirt", (104, 140, 180), "check", (238, 240, 242),
                 {"collar": 0.9, "length": 0.0445}),
         Garment("chinos", (150, 126, 96), "twill")),
        "boot", (92, 62, 42),
    ),
    Recipe(
        "henrik",
        _shape("m", 63, {"caucasian": 1.0},
               {"head/head-fat-incr": 0.3, "nose/nose-volume-incr": 0.5,
                "nose/nose-hump-incr": 0.4, "eyes/~-eye-bag-incr": 0.6,
                "ears/~-ear-scale-incr": 0.3, "stomach/stomach-tone-decr": 0.6,
                "mouth/mouth-laugh-lines-in": 0.5},
               muscle=-0.1, weight=0.3, proportions=-0.1),
        1.75,
        Face((211, 165, 145), (168, 104, 97), (78, 106, 132), (190, 188, 184), (134, 118, 100),
             brow_weight=0.7, flush=0.55, lines=0.8, stubble=0.15, grey=0.9),
        "receding",
        (Garment("jacket", (86, 84, 76), "twill", (214, 222, 232)),
         Garment("trousers", (66, 62, 58), "twill")),
        "loafer", (40, 30, 26),
    ),
    Recipe(
        "ike",
        _shape("m", 27, {"african": 1.0},
               {"head/head-square": 0.3, "chin/chin-prominent-incr": 0.2,
                "cheek/~-cheek-bones-incr": 0.3},
               muscle=0.5, weight=-0.1, proportions=0.5),
        1.842,
        Face((104, 68, 52), (116, 70, 62), (48, 30, 20), (18, 15, 14), (18, 15, 14),
             brow_weight=0.85, flush=0.1, stubble=0.5),
        "afro",
        (Garment("jumper", (206, 196, 176), "knit"), Garment("jeans", (34, 38, 50), "denim")),
        "sneaker", (240, 240, 238),
    ),
    Recipe(
        "jun",
        _shape("m", 40, {"asian": 1.0},
               {"head/head-diamond": 0.3, "nose/nose-scale-horiz-decr": 0.2,
                "chin/chin-height-incr": 0.2},
               muscle=-0.1, weight=0.05, proportions=0.1),
        1.72,
        Face((201, 158, 130), (154, 92, 83), (52, 34, 24), (22, 20, 22), (26, 24, 26),
             brow_weight=0.7, flush=0.55, stubble=0.3, lines=0.2),
        "fringe",
        (Garment("cardigan", (66, 78, 70), "knit", (232, 232, 228)),
         Garment("chinos", (72, 74, 84), "twill")),
        "sneaker", (70, 72, 78),
    ),
    Recipe(
        "karim",
        _shape("m", 47, {"caucasian": 0.5, "african": 0.35, "asian": 0.15},
               {"head/head-oval": 0.3, "nose/nose-hump-incr": 0.4,
                "nose/nose-scale-vert-incr": 0.3, "eyes/~-eye-bag-incr": 0.3,
                "eyebrows/eyebrows-trans-down": 0.3},
               muscle=0.1, weight=0.2, proportions=0.0),
        1.78,
        Face((176, 126, 94), (146, 88, 78), (66, 44, 28), (34, 28, 26), (30, 25, 24),
             brow_weight=1.0, flush=0.3, stubble=1.0, lines=0.4, grey=0.15),
        "short",
        (Garment("polo", (112, 40, 52), "plain"), Garment("chinos", (56, 62, 78), "twill")),
        "loafer", (58, 42, 34),
    ),
    Recipe(
        "luca",
        _shape("m", 38, {"caucasian": 0.85, "african": 0.15},
               {"head/head-oval": 0.4, "nose/nose-scale-vert-incr": 0.4,
                "nose/nose-curve-convex": 0.2, "chin/chin-jaw-drop-incr": 0.2,
                "ears/~-ear-scale-incr": 0.2, "cheek/~-cheek-bones-incr": 0.2},
               muscle=0.05, weight=-0.2, proportions=0.2),
        1.77,
        Face((200, 153, 124), (160, 95, 86), (96, 78, 48), (58, 42, 32), (46, 34, 28),
             brow_weight=0.85, flush=0.35, stubble=0.75, lines=0.15),
        "crop",
        (Garment("jumper", (84, 92, 60), "knit"), Garment("jeans", (44, 48, 58), "denim")),
        "boot", (70, 52, 40),
    ),
)  # fmt: skip
