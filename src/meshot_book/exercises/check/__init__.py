"""The checkers of the exercises, by name: ``check.NAME(your_function)`` prints one line."""

from meshot_book.exercises.beyond_exercises import centred_cost, chamfer_floor, gap_cost
from meshot_book.exercises.choice_exercises import averaged_weights, chosen_rate, luck_of_the_best
from meshot_book.exercises.convergence_exercises import mean_gap, points_needed, wrong_curve
from meshot_book.exercises.cost_exercises import blocked_chamfer, growth_exponent, merged_cells
from meshot_book.exercises.ddot_exercises import alignment, count_weights, feature_at, mean_displacements
from meshot_book.exercises.deforming_exercises import edge_variation, equal_time, safe_steps
from meshot_book.exercises.descent_exercises import largest_rate, line_arrows, nearest_arrows
from meshot_book.exercises.flow_exercises import euler_flow, pieces_needed, undo_step
from meshot_book.exercises.imaging_exercises import grid_affine, noise_from_air, pixel_share
from meshot_book.exercises.line_exercises import quantiles, transport_cost, weight_gradient
from meshot_book.exercises.local_exercises import pair_costs, partial_cost, window_weights
from meshot_book.exercises.measure_exercises import face_weights, mean_square, tent_density
from meshot_book.exercises.normal_exercises import area_gradient, is_inside_out, scale_for_share
from meshot_book.exercises.results_exercises import kept_check, observed_order, paired_gap
from meshot_book.exercises.ruler_exercises import breaks_bound, pairs_left, two_sided, without_floor
from meshot_book.exercises.scan_exercises import handles, is_simple, surface_ras
from meshot_book.exercises.slicing_exercises import ghost_pair, lines_needed, sliced_cost
from meshot_book.exercises.study_exercises import best_visits, group_size, pair_reliability
from meshot_book.exercises.surface_exercises import mask_euler, row_distance, soft_overlap
from meshot_book.exercises.systems_exercises import chance_missed, curved_chamfer, through_chain
from meshot_book.exercises.tables_exercises import best_motion, same_order, who_is_better
from meshot_book.exercises.trial_exercises import diagnosis, first_lead, forecast
from meshot_book.exercises.zoo_exercises import blur_in_coordinates, debiased, smallest_flip, trap

__all__ = [
    "alignment",
    "area_gradient",
    "averaged_weights",
    "best_motion",
    "best_visits",
    "blocked_chamfer",
    "blur_in_coordinates",
    "breaks_bound",
    "centred_cost",
    "chamfer_floor",
    "chance_missed",
    "chosen_rate",
    "count_weights",
    "curved_chamfer",
    "debiased",
    "diagnosis",
    "edge_variation",
    "equal_time",
    "euler_flow",
    "face_weights",
    "feature_at",
    "first_lead",
    "forecast",
    "gap_cost",
    "ghost_pair",
    "grid_affine",
    "group_size",
    "growth_exponent",
    "handles",
    "is_inside_out",
    "is_simple",
    "kept_check",
    "largest_rate",
    "line_arrows",
    "lines_needed",
    "luck_of_the_best",
    "mask_euler",
    "mean_displacements",
    "mean_gap",
    "mean_square",
    "merged_cells",
    "nearest_arrows",
    "noise_from_air",
    "observed_order",
    "pair_costs",
    "pair_reliability",
    "paired_gap",
    "pairs_left",
    "partial_cost",
    "pieces_needed",
    "pixel_share",
    "points_needed",
    "quantiles",
    "row_distance",
    "safe_steps",
    "same_order",
    "scale_for_share",
    "sliced_cost",
    "smallest_flip",
    "soft_overlap",
    "surface_ras",
    "tent_density",
    "through_chain",
    "transport_cost",
    "trap",
    "two_sided",
    "undo_step",
    "weight_gradient",
    "who_is_better",
    "window_weights",
    "without_floor",
    "wrong_curve",
]
