"""From results to verdicts: the rule for each tested claim, by its number."""

from meshot_book.claims.ledger import Judge
from meshot_book.claims.rules.axioms import judge_axioms
from meshot_book.claims.rules.convergence import judge_directions, judge_theorem
from meshot_book.claims.rules.cost import judge_memory, judge_speed
from meshot_book.claims.rules.ddot import judge_ablation, judge_systems
from meshot_book.claims.rules.deforming import judge_evenness, judge_supports
from meshot_book.claims.rules.encodings import judge_continuous, judge_normal_scale, judge_sample_gradient
from meshot_book.claims.rules.ground_cost import judge_ground_cost
from meshot_book.claims.rules.rates import judge_chamfer_rate, judge_transport_rate
from meshot_book.claims.rules.ruler import judge_counts, judge_floor, judge_table
from meshot_book.claims.rules.self_intersection import judge_self_intersection
from meshot_book.claims.rules.sinkhorn import judge_blur
from meshot_book.claims.rules.toy import judge_toy
from meshot_book.claims.rules.varifold import judge_varifold
from meshot_book.claims.rules.weights import judge_weights

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
