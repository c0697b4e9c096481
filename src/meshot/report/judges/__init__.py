"""From results to verdicts: the rule for each tested claim, by its number."""

from meshot.report.judges.axioms import judge_axioms
from meshot.report.judges.toy import judge_toy
from meshot.report.judges.weights import judge_weights
from meshot.report.ledger import Judge

JUDGES: dict[int, Judge] = {
    1: judge_toy,
    9: judge_weights,
    11: judge_axioms,
}
