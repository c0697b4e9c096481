"""From a scan to surfaces: conform, segment, find an initial surface, deform, report.

:func:`reconstruct` is the whole way. ``segmentation`` finds white matter, and a system of :mod:`meshot.systems`, which
:func:`run_system_training` trains, the surfaces; ``report`` writes the folder of a reconstruction and its page.
Surfaces are in scanner RAS, in mm.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
