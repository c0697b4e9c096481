"""Losses between measures: differentiable numbers that say how far two surfaces are apart.

Sliced Wasserstein and its windowed form, Chamfer, exact Wasserstein by linear programming, Sinkhorn divergence; the
directions of slicing, and the error bar of an estimate. ``composed`` composes an encoding and a loss by name.
``lines`` holds transport on one line, ``regularity`` the penalties of a single mesh.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
