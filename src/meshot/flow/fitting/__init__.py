"""Minimisation of a loss over the velocity field of a flow, or over the positions of free points.

:func:`fit_flow` fits a field with Adam, with checkpoints and exact resumption. :func:`descend` moves free points by
gradient descent. Other functions integrate and diagnose sequences of fitted flows.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
