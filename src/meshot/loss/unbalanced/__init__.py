"""Sliced transport between measures, parts of which are removed at a cost instead of being transported.

Partial transport (a cost per unit of mass) and unbalanced transport (a Kullback–Leibler penalty) along every direction,
and unbalanced transport with the same marginals for all directions. The ``reach`` is a length: mass is removed rather
than transported much farther.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
