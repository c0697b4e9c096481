"""The rules that compute verdicts from results, by number of the claim."""

from meshot_book.claims.ledger import Rule
from meshot_book.claims.rules.axioms import axioms_verdict
from meshot_book.claims.rules.comparison import consistency_verdict, systems_verdict
from meshot_book.claims.rules.convergence import directions_verdict, theorem_verdict
from meshot_book.claims.rules.cost import memory_verdict, speed_verdict
from meshot_book.claims.rules.counts import counts_verdict
from meshot_book.claims.rules.deforming import evenness_verdict, supports_verdict
from meshot_book.claims.rules.encodings import continuous_verdict, normal_scale_verdict, sample_gradient_verdict
from meshot_book.claims.rules.ground_cost import ground_cost_verdict
from meshot_book.claims.rules.local import local_verdict
from meshot_book.claims.rules.own_loss import own_loss_verdict
from meshot_book.claims.rules.rates import chamfer_rate_verdict, transport_rate_verdict
from meshot_book.claims.rules.ruler import floor_verdict, table_verdict
from meshot_book.claims.rules.self_intersection import self_intersection_verdict
from meshot_book.claims.rules.sinkhorn import blur_verdict
from meshot_book.claims.rules.toy import toy_verdict
from meshot_book.claims.rules.trial import exchanges_verdict
from meshot_book.claims.rules.varifold import varifold_verdict
from meshot_book.claims.rules.weights import weights_verdict

RULES: dict[int, Rule] = {
    1: toy_verdict,
    2: theorem_verdict,
    3: transport_rate_verdict,
    4: chamfer_rate_verdict,
    5: directions_verdict,
    6: continuous_verdict,
    7: varifold_verdict,
    8: normal_scale_verdict,
    9: weights_verdict,
    10: speed_verdict,
    11: axioms_verdict,
    12: self_intersection_verdict,
    13: systems_verdict,
    14: table_verdict,
    15: floor_verdict,
    16: counts_verdict,
    17: exchanges_verdict,
    18: blur_verdict,
    19: consistency_verdict,
    20: supports_verdict,
    21: memory_verdict,
    22: evenness_verdict,
    23: sample_gradient_verdict,
    24: ground_cost_verdict,
    25: local_verdict,
    26: own_loss_verdict,
}
