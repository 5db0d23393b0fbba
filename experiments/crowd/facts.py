"""What the source of the crowd study says about its design, procedure, measures and tests."""

from typing import Final

from visavis.analysis.collisions.series import MIN_DURATION_NS, THRESHOLD_M3
from visavis.analysis.gait import STEP_LENGTH_M
from visavis.devices.contracts import CONTACT_PATTERN
from visavis.experiments.crowd import published
from visavis.experiments.crowd.comparisons import PathThresholds
from visavis.experiments.crowd.design import DEFAULT_PARAMETERS, HAPTICS_GROUP
from visavis.experiments.crowd.haptics import BAND_ROLES, MOTORS
from visavis.experiments.crowd.walks import STEP_NS
from visavis.lab.clock import NS_PER_MS
from visavis.stimuli.contact.body import ARM_JOINTS
from visavis.stimuli.scenes.station_crowd import READ_WITHIN_M, ROOM_SIDE_M, SPACING_M
from visavis.study.source import Fact, PrintedOrder, Source

FACTS: Final = (
    Fact("design", "blocks", 3, "section 4.1.3", of="blocks"),
    Fact(
        "design",
        "order of blocks",
        "NoHaptic1, Haptic, NoHaptic2",
        "section 4.1.3",
        of="condition",
    ),
    Fact("design", "walks in a block", 8, "section 4.1.3", of="trials_in_block"),
    Fact("design", "configurations of the crowd", 8, "section 4.1.2", of="configuration"),
    Fact("design", "order of walks in a block", "random", "section 4.1.3", of="order"),
    Fact("design", "practice walks", 1, "section 4.1.3", of="practice"),
    Fact(
        "design",
        "control group",
        "none; asked for as future work",
        "section 4.4",
        "none, or half of the people (`--set groups=[haptics,control]`)",
        because="without one, what vibration does cannot be told from practice",
        is_stronger=True,
    ),
    Fact("design", "people on a square metre", 1.47, "section 4.1.2", of="density_per_m2"),
    Fact(
        "design",
        "spacing of people",
        "a gap of 0.60 m on average, Poisson",
        "section 4.1.2",
        f"centres at least {SPACING_M:g} m apart, drawn at random",
        because="the source prints no coordinates, so the eight crowds are ours",
    ),
    Fact(
        "design",
        "people's motion",
        "several recorded clips of waiting and of telephoning",
        "section 4.1.2",
        "waiting and telephoning computed for everybody, no two alike",
        because="no recorded clips come with Visavis",
    ),
    Fact(
        "design",
        "place",
        "the metro station Mayakovskaya",
        "section 4.1.2",
        "a metro station of ours",
        because="its model may not be passed on",
    ),
    Fact(
        "procedure",
        "metres from the board at which it shows",
        2,
        "section 4.1.2",
        here=READ_WITHIN_M,
    ),
    Fact(
        "procedure",
        "side of the tracked area in metres",
        10,
        "section 4.1.1",
        here=ROOM_SIDE_M,
    ),
    Fact("procedure", "posture", "standing", "section 4.1.2", of="posture"),
    Fact(
        "procedure",
        "task",
        "to the board, read the track aloud, back; walk as in a real station",
        "section 4.1.2",
    ),
    Fact(
        "procedure",
        "what is said of contact",
        "not said; people did not know that contact would vibrate",
        "section 4.4",
    ),
    Fact("procedure", "armbands", 4, "section 4.1.1", here=len(BAND_ROLES)),
    Fact("procedure", "motors of an armband", 4, "section 4.1.1", here=len(MOTORS)),
    Fact(
        "procedure",
        "bands in the silent blocks",
        "not said; everybody was equipped before the training walk",
        "section 4.1.3",
        "worn, silent",
        because="that is how we read it",
    ),
    Fact(
        "procedure",
        "segments of the arms that touch",
        6,
        "section 4.1.1",
        here=len(ARM_JOINTS),
    ),
    Fact(
        "procedure",
        "what they touch",
        "the geometry of the characters",
        "section 4.1.1",
        "capsules of the characters",
        because="a closed skinned surface cannot be tested at every sample of a tracker",
    ),
    Fact(
        "procedure",
        "vibration",
        "57 to 126 Hz, sine of 10 Hz, all motors of a band",
        "section 4.1.1",
        here=(
            f"{CONTACT_PATTERN.low_hz:g} to {CONTACT_PATTERN.high_hz:g} Hz, sine of "
            f"{CONTACT_PATTERN.modulation_hz:g} Hz, all motors of a band"
        ),
    ),
    Fact(
        "procedure",
        "updates of the bands a second",
        4,
        "section 4.1.1",
        of="haptic_update_hz",
        because="0 looks at every sample, and a command leaves within 5 ms: contact under 250 ms "
        "could go unfelt there; `--set haptic_update_hz=4` brings the source's link back",
        is_stronger=True,
    ),
    Fact(
        "procedure",
        "headset",
        "Pimax, 200° of field, 90 Hz, with a computer on the back",
        "section 4.1.1",
        "any headset that Visavis drives",
        because="labs have others",
    ),
    Fact(
        "procedure",
        "body tracker",
        "Xsens, kept at 45 Hz",
        "sections 4.1.1 and 4.2",
        "any body tracker that Visavis drives, kept at its own rate",
        because="nothing recorded is thrown away",
        is_stronger=True,
    ),
    Fact(
        "procedure",
        "own body",
        "of one's gender, in one's size",
        "section 4.1.2",
    ),
    Fact(
        "procedure",
        "questionnaires after a block",
        "embodiment, then presence, with the headset on",
        "section 4.1.3, appendix B.1",
    ),
    Fact(
        "procedure",
        "wording of embodiment and presence",
        "Roth and Latoschik; Slater, Usoh and Steed; 7 points",
        "tables B.2 to B.5",
        "reworded, not validated, 7 points; a lab puts licensed wording in",
        because="the wording belongs to its authors",
    ),
    Fact(
        "procedure",
        "end of a walk",
        "back at the start",
        "section 4.1.2",
        f"within {{home_within_m}} m of the mark, or after {DEFAULT_PARAMETERS.limit_s:g} s",
        because="a program needs a distance, and a walk that never comes back must end",
        is_stronger=True,
    ),
    Fact("measure", "least volume of a collision in m³", 1e-6, "section 4.2.1", here=THRESHOLD_M3),
    Fact(
        "measure",
        "least duration of a collision in ms",
        10,
        "section 4.2.1",
        here=MIN_DURATION_NS // NS_PER_MS,
    ),
    Fact(
        "measure",
        "steps of the analysis in ms",
        10,
        "section 4.2.1",
        here=STEP_NS // NS_PER_MS,
    ),
    Fact(
        "measure",
        "volume of a collision",
        "cubes of 1 cm that touch both bodies",
        "section 4.2.1",
        "the common volume of both bodies; the source's cubes beside it and beside the printed "
        "values",
        because="cubes overstate a common volume about twofold",
        is_stronger=True,
    ),
    Fact(
        "measure",
        "step left out round the board, men and women, in metres",
        "0.74 and 0.67",
        "appendix B.1",
        here=f"{STEP_LENGTH_M['man']:g} and {STEP_LENGTH_M['woman']:g}",
    ),
    Fact(
        "measure",
        "turn of shoulders",
        "to the line between the two people passed, 0 to 90°",
        "appendix B.1",
        "the same; the turn to the walking direction beside it",
        because="the angle to the gap also rises with oblique passing",
        is_stronger=True,
    ),
    Fact(
        "measure",
        "paths",
        "Delaunay cells visited, similarity by Dice",
        "appendix B.1",
    ),
    Fact(
        "test",
        "test over blocks",
        "Shapiro–Wilk, then analysis of variance (Greenhouse–Geisser) or Friedman; Bonferroni",
        "section 4.2.2",
    ),
    Fact(
        "test",
        "random halves of a block",
        30,
        "appendix B.2",
        here=PathThresholds().n_splits,
    ),
    Fact(
        "test",
        "paths between blocks against within",
        "whole blocks against halves of one",
        "appendix B.2",
        "the same; groups of one size with different people, a permutation test and a test of "
        "equivalence beside it",
        because="whole blocks look more alike than halves without any effect",
        is_stronger=True,
    ),
    Fact(
        "test",
        "volume over blocks",
        "volumes of cubes",
        "section 4.3",
        "common volumes; the means of cubes stand beside the printed ones",
        because="cubes overstate a common volume about twofold",
        is_stronger=True,
    ),
    Fact(
        "result",
        "volumes of simulated people",
        "0.8 and 0.6 dm³, of cubes, on the characters' meshes",
        "section 4.3",
        "fitted to be so on characters' surfaces; on the stouter capsules of the short path about "
        "1.1 and 0.9 (`python -m benchmarks.crowd_participants --surfaces 8`)",
        because="whole studies are simulated on capsules, which take a hundredth of the time",
    ),
    Fact(
        "result",
        "way of simulated people",
        "not said",
        "section 4.3",
        "some 32 m of a walk, where the shortest way is 21 m",
        because="they go round narrow gaps; nothing printed says how far the source's people went",
    ),
    Fact(
        "result",
        "similarity of paths, mean (SD) in Dice",
        "; ".join(
            (
                *(
                    f"{a} – {b} {mean:g} ({sd:g})"
                    for (a, b), (mean, sd) in published.DICE_BETWEEN_ALL.items()
                ),
                f"within a block {published.DICE_WITHIN.mean:g} ({published.DICE_WITHIN.sd:g})",
            )
        ),
        "appendix B.2, table B.1",
    ),
)
ORDERS: Final = (
    PrintedOrder(published.FELL, published.VOLUME_OF_CUBES, "section 4.3", factor="condition"),
)
"""The order of volumes as the source counts them; that of common volumes is tested."""
SOURCE: Final = Source(
    published.CITATION,
    published.PARTICIPANTS,
    published.MEANS,
    only={"group": HAPTICS_GROUP},
    where="sections 4.1.4 and 4.3, appendix B.2",
    facts=FACTS,
    orders=ORDERS,
)
