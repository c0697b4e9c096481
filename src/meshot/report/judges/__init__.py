"""From results to verdicts: the rule for each tested claim, by its number."""

from meshot.report.judges.toy import judge_toy
from meshot.report.ledger import Judge

JUDGES: dict[int, Judge] = {
    1: judge_toy,
}
