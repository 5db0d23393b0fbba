"""The method section, written from the parameters in force."""

from typing import Final

from analysis.collisions.series import MIN_DURATION_NS, THRESHOLD_M3
from analysis.gait import HESITATION_AT_LEAST_S, HESITATION_BELOW_M_S, STEP_LENGTH_M
from analysis.report.notation import percentage, threshold
from experiments.crowd.analysis import CrowdAnalysis
from experiments.crowd.analysis_parameters import RULES as EXCLUSIONS
from experiments.crowd.conclusions import RULE

REFERENCES: Final = (
    "Berton, F., Grzeskowiak, F., Bonneau, A., Jovane, A., Aggravi, M., Hoyet, L., Olivier, A.-H., "
    "Pacchierotti, C., & Pettré, J. (2020). Crowd navigation in VR: exploring haptic rendering of "
    "collisions. IEEE TVCG. 10.1109/TVCG.2020.3041341.",
    "Jovane, A. (2023). Thesis, Université de Rennes, chapter 4 and appendix B (the published "
    "values shown here).",
    "Cho, S. H., Park, J. M., & Kwon, O. Y. (2004). Gender differences in three dimensional gait "
    "analysis data from 98 healthy Korean adults. Clinical Biomechanics, 19, 145–152.",
    "Dice, L. R. (1945). Measures of the amount of ecologic association between species. "
    "Ecology, 26, 297–302.",
    "Schuirmann, D. J. (1987). A comparison of the two one-sided tests procedure. Journal of "
    "Pharmacokinetics and Biopharmaceutics, 15, 657–680.",
    "Schrödter, T., & the PedPy developers. PedPy: analysis of pedestrian dynamics (density by "
    "Voronoi cell, individual speed).",
)

RULES: Final = {
    "volume": (
        "the true common volume of the two closed surfaces: signed intervals along columns 1 cm "
        "apart, finer where small, inside where the surface winds round a point"
    ),
    "centres": "1 cm cubes whose centre lies in both bodies",
    "published": (
        "1 cm cubes that touch both bodies, counted only where they really share volume; "
        "overstates a volume about twofold"
    ),
}
SURFACES: Final = {
    "characters": "the closed collision meshes of the characters that were shown",
    "fine": "a closed body of about 15,000 triangles round the capsules of contact",
    "light": "a closed body of about 3,000 triangles round the capsules of contact",
    "capsules": "the nineteen capsules of contact themselves, along columns 12.5 mm apart",
}


def method_paragraphs(analysis: CrowdAnalysis) -> tuple[str, ...]:
    """Return the method section."""
    p = analysis.parameters
    first = analysis.trials.iloc[0]
    rule, surface = str(first["measure_rule"]), str(first["measure_surface"])
    return (
        "Participants walked through eight crowds of idle people in a station, to a board and "
        "back, in three blocks of fixed order: without haptics, with armbands that answer contact "
        "of hand, forearm and upper arm, and without again.",
        f"Collisions. Body and crowd are rebuilt every 10 ms. Volumes are by rule {rule!r}: "
        f"{RULES[rule]}; surfaces: {SURFACES[surface]}. A collision is one pair of participant "
        f"and character from the first to the last step above {THRESHOLD_M3:g} m³, counted when "
        f"longer than {MIN_DURATION_NS // 1_000_000} ms; its value is the largest volume. Body "
        "part and side are those of the participant nearest to the centre of the common volume "
        "at its largest; speed is that of the hips at first contact.",
        "Paths. Cells are the Delaunay triangles between people's positions in whole micrometres; "
        "path segments are walked exactly. Shoulder rotation is the angle between the line of the "
        "shoulders and the gap at every crossing between two people, 0–90°, and beside it the "
        f"same at gaps of at most {p.narrow_gap_m:g} m and the angle to the walking direction.",
        "Walking speed leaves out what lies within one step "
        f"({STEP_LENGTH_M['man']} m men, {STEP_LENGTH_M['woman']} m women) of the point nearest "
        f"the board. A hesitation is slower than {HESITATION_BELOW_M_S} m/s for at least "
        f"{HESITATION_AT_LEAST_S} s outside that stop, once walking has begun. "
        "Clearance is the distance to the nearest person's centre.",
        "Statistics are of each person's mean over the walks of a block. α = "
        f"{threshold(p.alpha)}. {RULE} Bounds of equal paths: ±{p.dice_bound:g} in Dice, "
        f"±{percentage(p.path_bound_01, 0)} of the path length; fixed before looking.",
        f"Left out were walks and people by these limits: {_limits(analysis)}. Nothing is made up "
        "for lost time.",
    )


def _limits(analysis: CrowdAnalysis) -> str:
    found = analysis.selection.limits
    return "; ".join(
        f"{rule.column} {'above' if rule.above else 'below'} {limit:g}"
        for rule in EXCLUSIONS
        if (limit := found[rule.name]) is not None
    )


def differences_from_source(analysis: CrowdAnalysis) -> tuple[str, ...]:
    """Return in what the measures differ from the source's."""
    differences = [
        "the crowds follow the source's density and spacing, but are not its eight crowds",
        "paths are also compared at equal group sizes with different people on both sides, and "
        "tested for equivalence; the source compared whole blocks with halves",
        "contact needs the arms' capsules; the source's avatars had a capsule per segment too",
        "people of neither or unknown sex have the mean step of men and women",
    ]
    if not any(rule.startswith("published") for rule in analysis.rules):
        differences.insert(
            0, "volumes are true common volumes; the source counted cubes touching both bodies"
        )
    return tuple(differences)
