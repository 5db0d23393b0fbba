"""References of a report, as programs for references read them."""

from visavis.results.report.references import GUIDELINE, HOLM, Reference, bibtex, ris


def test_a_known_work_has_its_fields_and_a_quoted_one_its_text() -> None:
    quoted = Reference("doe2020", "misc", year=2020, note="Doe (2020). 100 % of {it}. Press.")
    text = bibtex([GUIDELINE, quoted, quoted])
    assert "@article{dunn2024,\n  author = {Dunn, M. J. and others},\n  year = {2024}," in text
    assert "doi = {10.3758/s13428-023-02187-1}" in text
    assert r"note = {Doe (2020). 100 \% of (it). Press.}" in text
    assert ["dunn2024", "doe2020", "doe2020b"] == [
        line.partition("{")[2].rstrip(",") for line in text.splitlines() if line.startswith("@")
    ]


def test_ris_has_a_tag_a_line_and_an_end() -> None:
    lines = ris([HOLM]).splitlines()
    assert "TY  - JOUR" == lines[0]
    assert {"AU  - Holm, S.", "PY  - 1979", "SP  - 65", "EP  - 70"} <= set(lines)
    assert "ER  - " == lines[-1]
