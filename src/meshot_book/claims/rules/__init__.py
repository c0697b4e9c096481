"""The rules that compute verdicts from results, by number of the claim."""

from meshot_book.claims.ledger import Rule
from meshot_book.claims.rules import descents, measures, systems, theory
from meshot_book.claims.rules.systems import (
    consistency_verdict as consistency_verdict,
    exchanges_verdict as exchanges_verdict,
    local_verdict as local_verdict,
    systems_verdict as systems_verdict,
)

RULES: dict[int, Rule] = {
    1: descents.toy_verdict,
    2: theory.theorem_verdict,
    3: theory.transport_rate_verdict,
    4: theory.chamfer_rate_verdict,
    5: theory.directions_verdict,
    6: measures.continuous_verdict,
    7: measures.varifold_verdict,
    8: measures.normal_scale_verdict,
    9: measures.weights_verdict,
    10: descents.speed_verdict,
    11: theory.axioms_verdict,
    12: descents.self_intersection_verdict,
    13: systems.systems_verdict,
    14: systems.table_verdict,
    15: measures.floor_verdict,
    16: systems.counts_verdict,
    17: systems.exchanges_verdict,
    18: descents.blur_verdict,
    19: systems.consistency_verdict,
    20: descents.supports_verdict,
    21: descents.memory_verdict,
    22: descents.evenness_verdict,
    23: measures.sample_gradient_verdict,
    24: theory.ground_cost_verdict,
    25: systems.local_verdict,
    26: systems.own_loss_verdict,
}
