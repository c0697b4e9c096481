"""Fitting: the field whose flow, or the points whose descent, makes a loss least.

:func:`fit_flow` fits a field with Adam, with checkpoints and exact resume; :func:`descend` moves free points. Chains of
fitted flows are carried and reported here too.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
