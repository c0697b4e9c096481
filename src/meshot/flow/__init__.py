"""Flows of velocity fields, and the fitting of such fields.

:func:`integrate` moves points along a velocity field, forwards or backwards in time.
:func:`fit_flow` fits a field whose flow deforms one mesh into another; :func:`repair_crossings` mends
self-intersections. Only this subpackage imports torchdiffeq.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
