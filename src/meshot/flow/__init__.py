"""Flows of velocity fields, and the fitting of such fields.

:func:`integrate` moves points along a velocity field, forwards or backwards in time. Subpackages: ``fields`` (velocity
fields), ``fitting`` (fits a field whose flow deforms one mesh into another), ``crossings`` (detection and repair of
self-intersections). Only this subpackage imports torchdiffeq.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
