"""The ledger says what the committed results say, and nothing else."""

import json
import re

import pytest

from make_ledger import PAGE, ledger_page
from meshot_book.claims import cards, ledger
from meshot_book.claims.rules import RULES

#: Of the page with all details folded, and of one verdict.
MOST_WORDS, LONGEST_SENTENCE = 3000, 50


def test_the_committed_page_is_the_generated_one():
    assert PAGE.read_text(encoding="utf-8") == ledger_page(), "run: make ledger"


def test_every_claim_has_a_row(root):
    page = PAGE.read_text(encoding="utf-8")
    assert all(f"(claim-{number})=" in page and f"**{number}. " in page for number in range(1, 27))


def test_the_page_can_be_taken_in_at_a_glance():
    folded = re.compile(r"^::::\{dropdown\}.*?^::::$", re.M | re.S)
    unfolded = folded.sub("", PAGE.read_text(encoding="utf-8"))
    assert len(unfolded.split()) < MOST_WORDS
    sentences = re.findall(r"\.claim-status\} (.*)", unfolded)
    assert len(sentences) == 26
    assert [s for s in sentences if len(s.split()) > LONGEST_SENTENCE or not s.endswith(".")] == []


def test_questions_that_the_paper_does_not_ask_are_ours():
    _, ours = PAGE.read_text(encoding="utf-8").split("## Questions of ours")
    assert {int(n) for n in re.findall(r"\(claim-(\d+)\)=", ours)} == {6, 8, 9, 15, 20, 23, 24, 25, 26}


RECORD = {
    "results": {"gain": 2.0}, "config": {}, "command": "python experiments/x/run.py", "data": "synthetic",
    "seconds": 1.0, "commit": "abc", "date": "2026-01-01", "versions": {}, "machine": "x86_64",
}  # fmt: skip


def judge(record: dict) -> ledger.Verdict:
    gain = record["results"]["gain"]
    return ledger.Verdict(
        ledger.REPRODUCED if gain > 1 else ledger.NOT_REPRODUCED,
        "It gains.",
        (f"{gain}", "gain"),
        f"gain {gain}",
        "gain > 1",
    )


@pytest.fixture
def house(tmp_path):
    claims = tmp_path / "claims.yaml"
    claims.write_text("- {id: 7, claim: a gain, where: Fig. 9, paper: '3', experiment: x, chapter: 01_a}\n")
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "results.json").write_text(json.dumps(RECORD))
    return tmp_path


def page(house, judges):
    return cards.ledger_page(house / "claims.yaml", house, judges)


def test_status_follows_the_results(house):
    assert "[Reproduced.]{.claim-status} It gains." in page(house, {7: judge})
    (house / "x" / "results.json").write_text(json.dumps(RECORD | {"results": {"gain": 0.5}}))
    assert "[Not reproduced.]{.claim-status}" in page(house, {7: judge})
    assert "python experiments/x/run.py" in page(house, {7: judge})


def test_the_data_of_every_experiment_are_named_unless_the_claim_says_them(house):
    (house / "y").mkdir()
    other = RECORD | {"data": "another set", "command": "python experiments/y/run.py"}
    (house / "y" / "results.json").write_text(json.dumps(other))
    claims = house / "claims.yaml"
    claims.write_text(claims.read_text().replace("experiment: x", "experiment: x, also: [y]"))
    found = page(house, {7: lambda first, second: judge(first)})
    assert "Data\n: synthetic; another set\n" in found
    assert "`python experiments/x/run.py` (1 s on x86_64); `python experiments/y/run.py` (1 s on x86_64)" in found
    assert "Commit\n: `abc`, 2026-01-01\n" in found  # of both
    claims.write_text(claims.read_text().replace("experiment: x", "experiment: x, data: a part of it"))
    assert "Data\n: a part of it\n" in page(house, {7: lambda first, second: judge(first)})


def test_a_claim_without_results_or_judge_is_an_error(house):
    with pytest.raises(ValueError, match="no rule for it"):
        page(house, {})
    (house / "x" / "results.json").unlink()
    with pytest.raises(ValueError, match="does not exist"):
        page(house, {7: judge})


def test_a_status_must_be_one_of_the_eight():
    with pytest.raises(ValueError, match="splendid"):
        ledger.Verdict("splendid", "", ("", ""), "", "")


def test_every_judge_has_a_claim(root):
    claims = (root / "book" / "claims.yaml").read_text(encoding="utf-8")
    assert all(f"- id: {number}\n" in claims for number in RULES)
