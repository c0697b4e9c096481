"""From results to verdicts: the rule for each tested claim, by its number."""

from meshot.report.judges.axioms import judge_axioms
from meshot.report.judges.convergence import judge_directions, judge_theorem
from meshot.report.judges.cost import judge_memory, judge_speed
from meshot.report.judges.ddot import judge_ablation, judge_systems
from meshot.report.judges.deforming import judge_evenness, judge_supports
from meshot.report.judges.encodings import judge_continuous, judge_normal_scale, judge_sample_gradient
from meshot.report.judges.ground_cost import judge_ground_cost
from meshot.report.judges.rates import judge_chamfer_rate, judge_transport_rate
from meshot.report.judges.ruler import judge_counts, judge_floor, judge_table
from meshot.report.judges.self_intersection import judge_self_intersection
from meshot.report.judges.sinkhorn import judge_blur
from meshot.report.judges.toy import judge_toy
from meshot.report.judges.varifold import judge_varifold
from meshot.report.judges.weights import judge_weights
from meshot.report.ledger import Judge

JUDGES: dict[int, Judge] = {
    1: judge_toy,
    2: judge_theorem,
    3: judge_transport_rate,
    4: judge_chamfer_rate,
    5: judge_directions,
    6: judge_continuous,
    7: judge_varifold,
    8: judge_normal_scale,
    9: judge_weights,
    10: judge_speed,
    11: judge_axioms,
    12: judge_self_intersection,
    13: judge_systems,
    14: judge_table,
    15: judge_floor,
    16: judge_counts,
    17: judge_ablation,
    18: judge_blur,
    20: judge_supports,
    21: judge_memory,
    22: judge_evenness,
    23: judge_sample_gradient,
    24: judge_ground_cost,
}
