"""Cortical surface reconstruction: registration, segmentation, initial surface, deformation, report.

:func:`reconstruct` runs all steps. A network, trained by :func:`run_segmentation_training`, finds white matter. A
system of :mod:`meshot.systems`, trained by :func:`run_system_training`, finds the surfaces.
:func:`write_reconstruction` writes the output folder with an HTML page. Surfaces are in scanner RAS, in mm.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
