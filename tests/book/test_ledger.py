"""The ledger says what the committed results say, and nothing else."""

import json

import pytest

from make_ledger import PAGE, ledger_page
from meshot_book.claims import ledger
from meshot_book.claims.rules import RULES


def test_the_committed_page_is_the_generated_one():
    assert PAGE.read_text(encoding="utf-8") == ledger_page(), "run: make ledger"


def test_every_claim_has_a_row(root):
    page = PAGE.read_text(encoding="utf-8")
    assert all(f"(claim-{number})=" in page and f"**{number}. " in page for number in RULES)


RECORD = {
    "results": {"gain": 2.0}, "config": {}, "command": "python experiments/x/run.py", "data": "synthetic",
    "seconds": 1.0, "commit": "abc", "date": "2026-01-01", "versions": {}, "machine": "x86_64",
}  # fmt: skip


CLAIM = """- {id: 7, claim: a gain, where: Fig. 9, paper: '3', experiment: x, chapter: 01_a, status: reproduced,
   number: '{gain:.1f}', meaning: gain, says: It gains., found: 'gain {gain}', rule: gain > 1,
   tables: [{gain: '{gain:.2f}'}]}
"""


def judge(record: dict) -> ledger.Verdict:
    gain = record["results"]["gain"]
    return ledger.Verdict(ledger.REPRODUCED if gain > 1 else ledger.NOT_REPRODUCED, {"gain": gain}, ([{"gain": gain}],))


@pytest.fixture
def house(tmp_path):
    (tmp_path / "claims.yaml").write_text(CLAIM)
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "results.json").write_text(json.dumps(RECORD))
    return tmp_path


def page(house, judges):
    return ledger.ledger_page(house / "claims.yaml", house, judges)


def test_the_words_have_the_numbers_of_the_results(house):
    found = page(house, {7: judge})
    assert "[Reproduced.]{.claim-status} It gains." in found
    assert "[2.0]{.claim-number}\ngain\n" in found
    assert "Ours\n: gain 2.0\n" in found
    assert "| gain |\n| --- |\n| 2.00 |" in found
    assert "python experiments/x/run.py" in found


def test_other_results_ask_for_other_words(house):
    (house / "x" / "results.json").write_text(json.dumps(RECORD | {"results": {"gain": 0.5}}))
    asked = r"claim 7 \(a gain\): its words were written for 'reproduced', but the results now say 'not reproduced'"
    with pytest.raises(ValueError, match=asked):
        page(house, {7: judge})


def test_a_claim_that_is_not_tested_has_no_details(house):
    claims = house / "claims.yaml"
    claims.write_text(CLAIM.replace("experiment: x, ", ""))
    with pytest.raises(ValueError, match="now say 'not yet tested'"):
        page(house, {})
    claims.write_text(
        "- {id: 7, claim: a gain, status: not yet tested, number: –, meaning: no result, says: Nobody has tested it.}"
    )
    assert "[Not yet tested.]{.claim-status} Nobody has tested it.\n\n:::::" in page(house, {})


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


def test_a_theorem_names_its_proof_and_nothing_else_does(house):
    theorem = {7: lambda record: ledger.Verdict(ledger.PROVED, {"gain": 2.0}, ([{"gain": 2.0}],))}
    claims = house / "claims.yaml"
    claims.write_text(CLAIM.replace("status: reproduced", "status: decided by a proof"))
    with pytest.raises(
        ValueError, match=r"claim 7 \(a gain\): its status is 'decided by a proof', but it names no proof"
    ):
        page(house, theorem)
    claims.write_text(
        CLAIM.replace("status: reproduced", "status: decided by a proof, proof: 'by {prf:ref}`thm-gain`'")
    )
    found = page(house, theorem)
    assert "[Decided by a proof.]{.claim-status} It gains." in found
    assert "Proof\n: by {prf:ref}`thm-gain`\n" in found
    claims.write_text(CLAIM.replace("status: reproduced", "status: reproduced, proof: somewhere"))
    with pytest.raises(ValueError, match="its status is 'reproduced', but it names a proof"):
        page(house, {7: judge})
    assert "Proof" not in page_without_proof(house)


def page_without_proof(house):
    (house / "claims.yaml").write_text(CLAIM)
    return page(house, {7: judge})


def test_a_status_must_be_one_of_the_nine():
    with pytest.raises(ValueError, match="splendid"):
        ledger.Verdict("splendid", {})


@pytest.mark.parametrize(
    ("template", "text"),
    [
        ("{slopes:to −.2f}", "−0.50 to −0.25"),
        ("{slopes:.1f}", "-0.5, -0.2, -0.3"),
        ("{names:and}; {names:| words}; {nothing:;}", "a_b and c; a b | c; none"),
        ("{missing:.2f} {gap:interval} {one:interval}", "– +0.1 [-0.2, +0.3] +0.1"),
        ("{mean:spread} {only:spread} {no:spread}", "1.5 ± 0.25 1.5 –"),
        ("{share:percent} {many:percent} {none:percent}", "25 % 51.3 times 0 %"),
        ("{truth:yes} $m^{{-1/2}}$ {gap[low]:+.2f}", "yes $m^{-1/2}$ -0.20"),
    ],
)
def test_the_forms_of_numbers(template, text):
    values = {"slopes": [-0.5, -0.25, -0.3], "names": ["a_b", "c"], "nothing": [], "missing": None, "truth": True}
    values |= {"gap": {"gap": 0.1, "low": -0.2, "high": 0.3}, "one": {"gap": 0.1, "low": None, "high": None}}
    values |= {"mean": {"mean": 1.5, "sd": 0.25}, "only": {"mean": 1.5, "sd": None}, "no": {"mean": None, "sd": None}}
    assert ledger.fill(template, values | {"share": 0.25, "many": 51.3, "none": 1e-12}) == text


def test_rows_share_a_line_if_their_heads_differ():
    rows = [{"peer": peer, "m": m, "s": s} for peer, m, s in (("a", 10, 1.0), ("a", 20, 2.0), ("b", 20, 3.0))]
    lines = ledger.table(rows, {"peer": "{peer}", "m = {m}": "{s:.1f}"}).split("\n")
    assert lines == ["| peer | m = 10 | m = 20 |", "| --- | --- | --- |", "| a | 1.0 | 2.0 |", "| b | – | 3.0 |"]
    assert ledger.table(rows, {"peer": "{peer}"}).count("| a |") == 2
