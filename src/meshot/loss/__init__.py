"""Losses between measures, differentiable with respect to points and weights.

Sliced Wasserstein and its windowed form, Chamfer, exact Wasserstein by linear programming, Sinkhorn divergence;
directions for slicing, and error estimates; slices that are searched, weighted, corrected or lifted to a plan.
:func:`surface_loss` combines an encoding and a loss by name. Penalties of a single mesh, such as
:func:`squared_edge_length`, regularise.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
