"""Who simulated participants are, and how far what they felt changes each of them."""

from dataclasses import replace

import numpy as np
import pytest

from visavis.experiments.crowd.participant.participant import CrowdParticipant
from visavis.experiments.crowd.participant.route import STEP_M, choose_gaps, gap_graph
from visavis.experiments.crowd.participant.traits import (
    ALARM_MARGIN,
    ALARM_PER_S,
    CAREFUL_MARGIN,
    CAUTION_PER_S,
    CAUTION_TUCK,
    CLEAR,
    DEFAULT_POPULATION,
    DEPTH,
    FREE_SPEED,
    MARGIN,
    MAX_SPREAD_RAD,
    SPREAD,
    TUCK,
    WIDTH,
    draw_person,
    in_form,
)
from visavis.experiments.crowd.participant.walking import (
    ALARM,
    ASIDE,
    CAUTION,
    N_JOINTS,
    N_STATE,
    TURN,
    advance,
    walker_pose,
)
from visavis.experiments.crowd.participant.walking import TUCK as TUCKED
from visavis.lab.body_joints import BODY_JOINTS
from visavis.stimuli.contact.body import bones
from visavis.stimuli.scenes.station_crowd import READING_M, START_M, station_crowd


def traits_of(many=600, population=DEFAULT_POPULATION, *, feels=True):
    return np.stack(
        [draw_person(population, np.random.default_rng(k), feels=feels).traits for k in range(many)]
    )


def walked(traits, *, caution=0.0, alarm=0.0, gap_m=0.5, sway=0.0):
    """Return the states, one a row, on a long straight way through gaps of one width."""
    n = 400
    point = np.column_stack([np.zeros(n), -STEP_M * np.arange(n)])
    states = np.zeros((601, N_STATE))
    states[0, [CAUTION, ALARM]] = caution, alarm
    noise = sway * np.random.default_rng(5).standard_normal((601, 2))
    row = advance(
        states, 0, 300, traits, point, np.zeros(n), np.full(n, gap_m), np.ones(n), noise, 0.0, True
    )
    return states[: row + 1]


def turned_rad(traits, **options):
    """Return how far the shoulders turn there."""
    return walked(traits, **options)[-1, TURN]


def test_nobody_sways_into_people_beside_them():
    traits = draw_person(DEFAULT_POPULATION, np.random.default_rng(0), feels=False).traits
    settled = walked(traits, gap_m=0.4, sway=3.0)[200:]
    turn = np.abs(settled[:, TURN])
    across_m = traits[WIDTH] * np.cos(turn) + traits[DEPTH] * np.sin(turn)
    room_m = np.maximum((0.4 - across_m) / 2 - traits[CLEAR], 0.0)
    assert np.abs(settled[:, ASIDE]).max() <= room_m.max() + 0.001
    assert np.abs(walked(traits, gap_m=2.0, sway=3.0)[200:, ASIDE]).max() > 0.05


@pytest.mark.parametrize("configuration", range(9))
def test_nobody_goes_through_a_gap_into_which_no_turned_body_fits(configuration):
    graph = gap_graph(station_crowd(configuration))
    mark, board = np.array(START_M), np.array(READING_M)
    gaps = choose_gaps(
        graph, mark, board, np.ones(len(graph.free_m)), squeeze=0.0, easy_gap_m=0.8
    )  # who minds no squeeze at all
    assert DEFAULT_POPULATION.walking.body_depth_m < 0.3 < graph.free_m[gaps].min()


def test_arms_come_in_where_it_is_narrow():
    traits = draw_person(DEFAULT_POPULATION, np.random.default_rng(0), feels=False).traits
    wide, narrow = (walked(traits, gap_m=gap_m)[-1, TUCKED] for gap_m in (1.2, 0.4))
    assert wide == pytest.approx(0.0)
    assert 0.5 * traits[TUCK] < narrow < traits[TUCK]


def test_margins_kept_after_learning_differ_less_than_own_ones():
    people = traits_of()
    printed = 3.7 / 6.0  # SD of shoulder turns in the last block and in the first
    assert people[:, MARGIN].std() * printed > people[:, CAREFUL_MARGIN].std() > 0


def test_who_keeps_a_wide_margin_learns_a_wide_one_and_is_alarmed_more():
    people = traits_of()
    assert 0.5 < np.corrcoef(people[:, MARGIN], people[:, CAREFUL_MARGIN])[0, 1] < 0.9
    assert 0.5 < np.corrcoef(people[:, MARGIN], people[:, ALARM_MARGIN])[0, 1] < 0.9


def test_alarm_narrows_the_margin_in_some_and_widens_it_on_average():
    alarmed = traits_of()[:, ALARM_MARGIN]
    assert 0.02 < alarmed.mean()
    assert 0.1 < (alarmed < 0).mean() < 0.5


def test_form_changes_a_walk_round_what_the_person_is():
    person = draw_person(DEFAULT_POPULATION, np.random.default_rng(0), feels=True)
    rng = np.random.default_rng(1)
    walks = np.array(
        [in_form(person, DEFAULT_POPULATION, z) for z in rng.standard_normal((500, 4))]
    )
    assert person.traits.tolist() == in_form(person, DEFAULT_POPULATION, np.zeros(4)).tolist()
    pace = np.log(walks[:, FREE_SPEED] / person.traits[FREE_SPEED])
    assert DEFAULT_POPULATION.form.form_pace == pytest.approx(pace.std(), rel=0.1)
    assert pace.mean() == pytest.approx(0.0, abs=0.02)
    assert walks[:, SPREAD].max() <= MAX_SPREAD_RAD


def test_form_of_a_walk_hangs_on_person_and_walk_alone_and_changes_over_walks():
    once, again = CrowdParticipant(0, 3), CrowdParticipant(0, 3, effect=False)
    again.prepare(17, 5_000_000_000)
    later = again.form(2)
    assert once.form(2).tolist() == later.tolist()
    forms = np.array([once.form(walk) for walk in range(1, 400)])
    assert 1.0 == pytest.approx(forms.std(), abs=0.15)
    near, far = (np.corrcoef(forms[:-k].ravel(), forms[k:].ravel())[0, 1] for k in (1, 24))
    assert near > 0.9
    assert abs(far) < 0.3


def test_caution_brings_unlike_people_to_like_turns():
    tight, wide = traits_of(2)
    wide[:] = tight
    tight[MARGIN], wide[MARGIN] = 0.0, 0.06
    own = turned_rad(wide) - turned_rad(tight)
    assert 0.1 < own
    assert turned_rad(wide, caution=1.0) - turned_rad(tight, caution=1.0) < 0.1 * own


def test_alarm_turns_shoulders_farther_by_what_a_person_answers():
    (person,) = traits_of(1)
    person[ALARM_MARGIN] = 0.05
    calm = turned_rad(person)
    assert turned_rad(person, alarm=1.0) > calm + 0.02
    person[ALARM_MARGIN] = -0.05
    assert turned_rad(person, alarm=1.0) < calm - 0.02
    person[ALARM_MARGIN] = 0.0
    assert calm == pytest.approx(turned_rad(person, alarm=1.0))


def test_some_people_get_careless_and_most_bring_their_arms_in():
    answer = traits_of()[:, CAUTION_TUCK]
    assert 0.02 < (answer < 0).mean() < 0.2


def test_nobody_brings_arms_in_farther_than_to_the_body():
    tucked = [walked(t, caution=1.0, gap_m=0.2)[-1, TUCKED] for t in traits_of(100)]
    assert 0.9 < max(tucked) <= 1.0


def test_careless_arms_hang_out_no_farther_than_joints_allow():
    people = traits_of()
    tuck = np.minimum(people[:, CAUTION_TUCK], 0.0)  # where it is wide, own habit adds nothing
    assert (people[:, SPREAD] * (1 - tuck)).max() < np.radians(90)
    assert people[:, SPREAD].max() == MAX_SPREAD_RAD


def test_arms_of_the_loose_come_in_least():
    people = traits_of()
    loose = people[:, SPREAD] > np.median(people[:, SPREAD])
    assert people[loose, CAUTION_TUCK].mean() < 0.7 * people[~loose, CAUTION_TUCK].mean()


def test_without_spread_everybody_answers_alike():
    alike = replace(DEFAULT_POPULATION.caution, caution_tuck_spread=0.0, loose_response=0.0)
    arms = replace(DEFAULT_POPULATION.arms, tuck_spread=0.0)
    same = replace(DEFAULT_POPULATION, caution=alike, arms=arms)
    assert np.ptp(traits_of(50, same)[:, CAUTION_TUCK]) == 0.0


def test_who_does_not_feel_is_the_same_person_but_never_learns():
    felt, numb = traits_of(20), traits_of(20, feels=False)
    learning = [CAUTION_PER_S, ALARM_PER_S]
    assert (numb[:, learning] == 0.0).all()
    felt[:, learning] = 0.0
    assert felt.tolist() == numb.tolist()


def test_elbows_of_careless_arms_bend_no_less_than_those_at_rest():
    skeleton = bones()

    def elbow_deg(tuck):
        state = np.zeros(N_STATE)
        state[TUCKED] = tuck
        root, local = np.empty((1, 3)), np.empty((1, N_JOINTS, 4))
        at, turn = np.empty((1, N_JOINTS, 3)), np.empty((1, N_JOINTS, 4))
        walker_pose(state, 1.75, 0.3, skeleton.parents, skeleton.offsets_m, root, local, at, turn)
        shoulder, elbow, hand = (
            at[0, BODY_JOINTS.index(f"left_{part}")] for part in ("upper_arm", "lower_arm", "hand")
        )
        upper, lower = elbow - shoulder, hand - elbow
        cosine = upper @ lower / np.linalg.norm(upper) / np.linalg.norm(lower)
        return np.degrees(np.arccos(cosine))

    assert elbow_deg(0.0) == pytest.approx(elbow_deg(-0.6), abs=1e-6)
    assert elbow_deg(0.8) > elbow_deg(0.0) + 5
