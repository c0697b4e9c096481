"""Optimal-transport losses for surfaces.

A mesh is represented by a probability measure (:func:`surface`, :func:`empirical`, :func:`varifold`). A loss compares
two measures (:func:`sliced_wasserstein`, :func:`chamfer`, :func:`wasserstein`, :func:`sinkhorn_divergence`). The
functions listed here are the most used ones. The subpackages (``meshot.mesh``, ``meshot.loss``, ``meshot.flow`` and so
on) contain the others.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = "0.1.0"
