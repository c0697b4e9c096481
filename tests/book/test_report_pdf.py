"""The reproduction report says what the committed results say, and nothing that is typed."""

import json
import re

import pytest
import yaml

import report
from meshot_book.claims.rules import RULES

TEXT = report.TEXT.read_text(encoding="utf-8")
STATED = yaml.safe_load(report.VALUES.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def content():
    return report.content()


@pytest.fixture(scope="module")
def pdf(tmp_path_factory):
    return report.write_report(tmp_path_factory.mktemp("report") / "report.pdf")


def test_the_report_has_the_pages_that_journals_ask_for(pdf):
    assert 8 <= report.n_pages(pdf) <= 12


def test_every_name_has_a_text_and_a_source(content):
    assert content["values"].keys() == report.names_used(TEXT)
    for row in content["sources"]:
        assert row["text"], row
        assert not re.search(r"[{}_]|None|–|nan", row["text"]), row
        assert all(row[field] for field in ("file", "key", "commit")), row


def test_all_claims_are_in_the_table(content):
    assert sorted(int(row["id"]) for row in content["claims"]) == sorted(RULES)
    assert sum(n for _, n in content["statuses"]) == len(RULES)


def test_numbers_are_those_of_the_results(content, root):
    record = json.loads((root / "experiments/convergence/results.json").read_text(encoding="utf-8"))
    (row,) = (r for r in record["results"]["distance"] if (r["n_points"], r["p"]) == (10000, 2))
    assert content["values"]["growth"]["text"] == f"{row['error'][-1] / row['error'][1]:.3g}"
    assert content["values"]["growth"]["commit"] == record["commit"]


def test_no_number_is_typed():
    assert report.typed_numbers(TEXT) == []


@pytest.mark.parametrize(
    ("words", "typed"),
    [
        ("ASSD falls by .35 mm", ["35"]),
        ("the error is $99.4$ times larger", ["99.4"]),
        ("twelve of them, and Twenty", ["twelve", "Twenty"]),
        ("16 subjects, #v(\"a1\") and 5", ["16", "5"]),
        ("$p = 2$, 95 %, Table 1, rows 3, 4 and 26, MNI152, @key2024, <sec-1>, $m^(-1 slash 2)$", []),
        ("// 12 in a comment", []),
    ],
)  # fmt: skip
def test_a_typed_number_is_seen(words, typed):
    assert [found.strip(".,") for found in report.typed_numbers(words)] == typed


def test_a_typed_number_is_refused(root):
    with pytest.raises(ValueError, match=r"typed numbers 0\.35; write #v"):
        report.content(root, "It is 0.35 mm.", {})


def test_names_have_to_agree(root):
    with pytest.raises(ValueError, match=r"uses gap, which values\.yaml does not have"):
        report.content(root, '#v("gap")', {})
    with pytest.raises(ValueError, match=r"has spare_a, spare_b, which report\.typ does not use"):
        report.content(root, "Nothing.", {"spare_<x>": {"each": {"x": ["a", "b"]}, "printed": 1, "place": "Table 1"}})
    with pytest.raises(ValueError, match=r"'gap' has file; allowed"):
        report.content(root, '#v("gap")', {"gap": {"file": "comparison"}})


RECORD = {
    "results": {
        "rows": [{"arm": "a", "n": 1200, "gap": {"gap": -0.5, "low": -1, "high": 0.25}}, {"arm": "ab", "n": 4}],
    },
    "config": {}, "command": "c", "data": "d", "seconds": 7200, "commit": "abc", "date": "2026-01-01", "versions": {},
    "machine": "m",
}  # fmt: skip


@pytest.fixture
def house(tmp_path):
    (tmp_path / "experiments" / "x").mkdir(parents=True)
    (tmp_path / "experiments" / "x" / "results.json").write_text(json.dumps(RECORD))
    return tmp_path


def value(house, **entry):
    return report.value_of("name", entry, house, {})


@pytest.mark.parametrize(
    ("entry", "text"),
    [
        ({"at": "results.rows[arm=a].gap", "show": "{value:interval}"}, "−0.5 [−1, +0.25]"),
        ({"at": "results.rows[arm=a].gap", "show": "{low:.1f}"}, "−1.0"),
        ({"at": "results.rows[0].n", "show": "{value:_}"}, "1 200"),
        ({"at": "results.rows[* arm^=a].n", "take": "ends", "show": "{value:to}"}, "4 to 1200"),
        ({"at": "results.rows[*].n", "take": "sum", "over": 1000, "show": "{value:.3f}"}, "1.204"),
        ({"at": "seconds", "over": 3600, "show": "{value:.0e}"}, "2·10⁰"),
    ],
)  # fmt: skip
def test_keys_lead_to_values(house, entry, text):
    assert value(house, of="x", **entry)["text"].replace("\N{NARROW NO-BREAK SPACE}", " ") == text


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        ({"of": "gone", "at": "seconds"}, r"the value 'name' of the report: .*gone.results\.json does not exist"),
        ({"of": "x", "at": "results.rose"}, r"'name' of the report: the key 'results\.rose' has no 'rose'; there is "),
        ({"of": "x", "at": "results.rows[arm=b].n"}, r"\[arm=b\] must choose one row, and chooses 0"),
        ({"of": "x", "at": "results.rows[arm^=a].n"}, r"must choose one row, and chooses 2"),
        ({"of": "x", "at": "seconds[*]"}, r"chooses rows of a int; it needs a list or a dict"),
        ({"of": "x", "at": "results rows"}, r"cannot be read from ' rows' on"),
        ({"stored": "40_none/tab-x", "row": "1", "column": "a"}, r"40_none\.ipynb has no figure or table 'tab-x'"),
    ],
)  # fmt: skip
def test_a_missing_result_is_refused(house, entry, why):
    with pytest.raises(ValueError, match=why):
        value(house, **entry)


def test_results_without_provenance_are_refused(house):
    (house / "experiments/x/results.json").write_text(json.dumps({"results": {}}))
    with pytest.raises(ValueError, match="results without provenance do not count"):
        value(house, of="x", at="results")


def test_a_formula_that_typst_does_not_know_is_refused():
    assert report.markup(r"a #1 of $\lVert x - y \rVert_p^p$") == r"a \#1 of $norm(x - y)_p^p$"
    with pytest.raises(ValueError, match=r"has a macro that Typst does not know"):
        report.markup(r"$\operatorname x$")


def test_a_figure_without_a_stored_picture_is_refused(root):
    with pytest.raises(ValueError, match="has no stored output of the kind image/png"):
        report.stored_figure(root / "notebooks", "28_fair_trial/tab-local-share")
