"""Figures of meshes as measures, of convergence, of cost and of planted errors."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
