"""Anatomy of the head outside the cerebral cortex, taken from the MNI152 average.

:func:`template_tissue` finds ventricles, deep grey matter, cerebellum and brainstem in the average.
:class:`CarriedHead` moves them to a synthetic subject by the deformation that made its cortex, and adds the leaves of
the cerebellum, which an average does not show.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
