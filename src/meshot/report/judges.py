"""From results to verdicts: the rule for each tested claim."""

from meshot.report.ledger import Judge

JUDGES: dict[int, Judge] = {}
