from textwrap import dedent

import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.lab.errors import ConfigError, UsageError
from visavis.protocol.plan.questionnaires import (
    available,
    load_questionnaire,
    read_answer,
    score,
    score_range,
    unanswered_questions,
)

SMALL = """\
name: small
title: Small
version: 1
licence: ours
scales:
  agree: {options: {1: "no", 2: perhaps, 3: "yes"}}
  age: {kind: number, minimum: 18, maximum: 99}
  words: {kind: text}
items:
  - {id: calm, text: I am calm., scales: [agree], tags: [ease], reverse: true}
  - {id: tense, text: I am tense., scales: [agree], tags: [strain]}
  - {id: alert, text: I am alert., scales: [agree], tags: [strain]}
  - {id: age, text: "How old?", scales: [age]}
  - {id: note, text: "A note?", scales: [words], required: false}
scores:
  strain: {scales: [agree], missing_allowed: 1}
  mean_strain: {method: mean, scales: [agree], missing_allowed: 1}
  strict: {tags: [strain]}
  one: {items: [calm]}
"""
LSAS = load_questionnaire("social_anxiety")
LSAS_IDS = [q.question_id for q in LSAS.questions()]


def write(tmp_path, text, name="small.yaml"):
    path = tmp_path / name
    path.write_text(dedent(text), encoding="utf-8")
    return path


@pytest.fixture
def small(tmp_path):
    return load_questionnaire(write(tmp_path, SMALL))


# ---- those that come with Visavis ------------------------------------------------------------


def test_shipped_questionnaires_load_with_licence_and_distinct_questions():
    assert (
        "demographics",
        "embodiment",
        "free_comment",
        "igroup_presence",
        "presence",
        "simulator_sickness",
        "social_anxiety",
        "workload",
    ) == available()
    for name in available():
        questionnaire = load_questionnaire(name)
        ids = [q.question_id for q in questionnaire.questions()]
        assert name == questionnaire.name
        assert len(ids) == len(set(ids))
        assert questionnaire.licence


def test_liebowitz_structure_is_24_situations_by_fear_and_avoidance():
    assert 24 == len(LSAS.items)
    assert 48 == len(LSAS_IDS)
    tags = [item.tags for item in LSAS.items]
    assert (13, 11) == (tags.count(["performance"]), tags.count(["interaction"]))
    assert {(0, 1, 2, 3)} == {tuple(scale.options) for scale in LSAS.scales.values()}


def test_liebowitz_scores_have_the_published_ranges():
    tops = {
        "total": 144,
        "fear": 72,
        "avoidance": 72,
        "performance": 78,
        "interaction": 66,
        "fear_performance": 39,
        "fear_interaction": 33,
        "avoidance_performance": 39,
        "avoidance_interaction": 33,
    }
    assert {name: (0, top) for name, top in tops.items()} == {
        name: score_range(LSAS, name) for name in LSAS.scores
    }
    assert tops == score(LSAS, dict.fromkeys(LSAS_IDS, 3))


@given(st.lists(st.integers(0, 3), min_size=48, max_size=48))
def test_liebowitz_subscales_add_up_to_the_total(values):
    scores = score(LSAS, dict(zip(LSAS_IDS, values, strict=True)))
    assert sum(values) == scores["total"]
    assert scores["total"] == scores["fear"] + scores["avoidance"]
    assert scores["total"] == scores["performance"] + scores["interaction"]
    assert scores["fear"] == scores["fear_performance"] + scores["fear_interaction"]


def test_liebowitz_missing_answer_makes_its_own_scores_missing():
    answers = dict.fromkeys(LSAS_IDS, 1)
    del answers["eye_contact.avoidance"]
    missing = {name for name, value in score(LSAS, answers).items() if value is None}
    assert {"total", "avoidance", "interaction", "avoidance_interaction"} == missing
    assert ("eye_contact.avoidance",) == unanswered_questions(LSAS, answers)


def test_free_comment_may_stay_empty():
    assert () == unanswered_questions(load_questionnaire("free_comment"), {})


# ---- asking and scoring ----------------------------------------------------------------------


def test_questions_come_in_order_with_prompt_and_labels(small):
    questions = list(small.questions())
    assert ["calm", "tense", "alert", "age", "note"] == [q.question_id for q in questions]
    assert ("I am calm.", ("no", "perhaps", "yes")) == (questions[0].prompt, questions[0].options)
    assert () == questions[3].options
    assert "You are introduced to people you have never met. How anxious does this make you?" in [
        q.prompt for q in LSAS.questions()
    ]


def test_reverse_items_turn_round_within_their_scale(small):
    assert {1: 3, 2: 2, 3: 1} == {v: score(small, {"calm": v})["one"] for v in (1, 2, 3)}


def test_scores_of_a_worked_example(small):
    # calm 1 turns into 3; 3 + 2 + 3 = 8
    answers = {"calm": "no", "tense": "perhaps", "alert": "YES"}
    expected = {"strain": 8, "mean_strain": 8 / 3, "strict": 5, "one": 3}
    assert expected == pytest.approx(score(small, answers))


def test_missing_answers_within_the_allowance_are_made_up_by_the_mean(small):
    scores = score(small, {"calm": 1, "tense": 2, "alert": None})
    assert {"strain": 7.5, "mean_strain": 2.5, "strict": None, "one": 3} == scores


def test_missing_answers_beyond_the_allowance_make_scores_missing(small):
    assert {"strain": None, "mean_strain": None, "strict": None, "one": 3} == score(
        small, {"calm": 1}
    )
    assert {None} == set(score(small, {}).values())


@pytest.mark.parametrize(
    ("question", "given_answer", "value"),
    [
        (0, "perhaps", 2),
        (0, " Perhaps ", 2),
        (0, "2", 2),
        (0, 2, 2),
        (0, "", None),
        (0, None, None),
        (3, "30", 30),
        (3, "30,5", 30.5),
        (4, "  several words ", "several words"),
    ],
)
def test_answers_are_read_as_label_value_number_or_text(small, question, given_answer, value):
    assert value == read_answer(list(small.questions())[question], given_answer)


@pytest.mark.parametrize(
    ("question", "given_answer", "message"),
    [
        (0, "maybe", "choose from 1 no, 2 perhaps, 3 yes"),
        (0, 4, "choose from"),
        (3, "thirty", "not a number"),
        (3, "30 s", "not a number"),
        (3, "3", "at least 18 and at most 99"),
    ],
)
def test_an_impossible_answer_says_what_is_possible(small, question, given_answer, message):
    with pytest.raises(UsageError, match=message):
        read_answer(list(small.questions())[question], given_answer)


def test_unanswered_lists_required_questions_in_order(small):
    assert ("calm", "alert") == unanswered_questions(small, {"tense": 1, "age": 20, "alert": " "})


def test_an_answer_to_no_question_is_refused(small):
    with pytest.raises(UsageError, match=r"no question 'tens'; did you mean 'tense'"):
        score(small, {"tens": 1})


# ---- wording of the lab ----------------------------------------------------------------------

FRENCH = """\
questionnaire: small
language: fr
title: Petit
scales:
  agree: {options: {1: non, 2: peut-être, 3: oui}}
items:
  calm: Je suis calme.
"""


def test_wording_replaces_texts_and_nothing_else(tmp_path, small):
    french = load_questionnaire(
        write(tmp_path, SMALL), wording=write(tmp_path, FRENCH, "français é.yaml")
    )
    questions = list(french.questions())
    assert ("Je suis calme.", ("non", "peut-être", "oui")) == (
        questions[0].prompt,
        questions[0].options,
    )
    assert ("fr", "Petit") == (french.language, french.title)
    assert [q.question_id for q in small.questions()] == [q.question_id for q in questions]
    answers = {"calm": "non", "tense": "peut-être", "alert": "oui"}
    assert score(small, {"calm": 1, "tense": 2, "alert": 3}) == score(french, answers)


def test_wording_for_what_is_not_there_names_every_line(tmp_path):
    wrong = """\
    questionnaire: other
    language: fr
    scales:
      agre: {prompt: x}
      agree: {options: {4: jamais, 1: oui, 3: oui}}
    items:
      clam: Calme.
    """
    with pytest.raises(ConfigError) as caught:
        load_questionnaire(write(tmp_path, SMALL), wording=write(tmp_path, wrong, "w.yaml"))
    assert [
        (1, "questionnaire"),
        (4, "scales.agre"),
        (5, "scales.agree"),
        (5, "scales.agree.options.4"),
        (7, "items.clam"),
    ] == [(p.line, p.key) for p in caught.value.problems]
    assert "did you mean 'calm'" in str(caught.value)


# ---- files that are wrong --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("version: 1", "version: 0", 3, "greater than or equal to 1"),
        ("licence: ours", "", 1, "licence: is missing"),
        ("title: Small", "titel: Small", 2, "did you mean 'title'"),
        ('1: "no"', "1: no", 6, "put it in quotes"),
        ('1: "no", 2: perhaps, 3: "yes"', "1: x", 6, "at least two options"),
        ("2: perhaps", '2: "YES"', 6, "labels must differ"),
        ("maximum: 99", "maximum: 9", 7, "minimum must be less than maximum"),
        ("kind: text", "kind: text, minimum: 1", 8, "belong to scales of kind number"),
        ("kind: text", "kind: prose", 8, "should be 'options', 'number' or 'text'"),
        ("id: tense", "id: calm", 11, "given twice, first on line 10"),
        ("id: tense", "id: Tense", 11, "small letters"),
        ("text: I am tense., scales: [agree]", "text: x, scales: [agre]", 11, "mean 'agree'"),
        ("scales: [words]", "scales: [words, words]", 14, "given twice"),
        ("scales: [age]", "scales: [age], reverse: true", 13, "no options to turn round"),
        ("strict: {tags: [strain]}", "strict: {tags: [strian]}", 18, "mean 'strain'"),
        ("one: {items: [calm]}", "one: {items: [note]}", 19, "no question belongs"),
        ("one:", "strict:", 19, "given twice, first on line 18"),
    ],
)
def test_a_wrong_file_names_the_line_and_the_way_out(tmp_path, old, new, line, message):
    assert old in SMALL
    with pytest.raises(ConfigError) as caught:
        load_questionnaire(write(tmp_path, SMALL.replace(old, new)))
    assert message in str(caught.value)
    assert line in [p.line for p in caught.value.problems]


def test_all_problems_are_told_at_once(tmp_path):
    text = SMALL.replace("version: 1", "version: x").replace("id: tense", "idd: tense")
    with pytest.raises(ConfigError, match="3 problems"):
        load_questionnaire(write(tmp_path, text))


def test_an_unknown_name_gives_the_nearest(tmp_path):
    with pytest.raises(ConfigError, match="did you mean 'demographics'"):
        load_questionnaire("demografics")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"nowhere\.yaml is not there"):
        load_questionnaire(tmp_path / "nowhere.yaml")


# ---- sickness, presence, workload: the published structure and weights ------------------------


def test_simulator_sickness_has_the_published_weights_and_ranges():
    ssq = load_questionnaire("simulator_sickness")
    assert 16 == len(ssq.items)
    counts = [sum(tag in i.tags for i in ssq.items) for tag in ("nausea", "oculomotor")]
    assert [7, 7, 7] == [*counts, sum("disorientation" in i.tags for i in ssq.items)]
    # Kennedy and others (1993): each raw sum by its weight; the total adds the three sums.
    worst = {q.question_id: "severe" for q in ssq.questions()}
    expected = {"nausea": 200.34, "oculomotor": 159.18, "disorientation": 292.32, "total": 235.62}
    for answers, share in ((worst, 1.0), (dict.fromkeys(worst, "slight"), 1 / 3)):
        scores = score(ssq, answers)
        assert {k: pytest.approx(share * v) for k, v in expected.items()} == scores
    for name, most in expected.items():
        assert (0.0, pytest.approx(most)) == score_range(ssq, name)
    one = dict.fromkeys(worst, "none") | {"sick_hard_to_focus": "moderate"}  # counts in two scales
    scores = score(ssq, one)
    assert [0.0, 15.16, 27.84, 14.96] == [pytest.approx(v) for v in scores.values()]


def test_igroup_presence_turns_reversed_items_round():
    ipq = load_questionnaire("igroup_presence")
    tags = [i.tags for i in ipq.items]
    sizes = [tags.count([t]) for t in ("general", "place", "involvement", "realness")]
    assert [1, 5, 4, 4] == sizes
    fully = {
        q.question_id: "0 not at all" if q.item.reverse else "6 completely" for q in ipq.questions()
    }
    assert {6.0} == set(score(ipq, fully).values())
    assert (0.0, 6.0) == score_range(ipq, "place")


def test_workload_is_the_mean_of_six_demands_from_0_to_100():
    tlx = load_questionnaire("workload")
    ids = [q.question_id for q in tlx.questions()]
    assert 6 == len(ids)
    answers = dict(zip(ids, ("10", "20", "30", "40", "50", "60"), strict=True))
    assert {"workload": 35.0} == score(tlx, answers)
    assert (0.0, 100.0) == score_range(tlx, "workload")
