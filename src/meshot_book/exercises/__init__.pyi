from .convergence_exercises import drawn_curves as drawn_curves
