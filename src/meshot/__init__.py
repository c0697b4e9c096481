"""Optimal-transport losses for surfaces, from points on a line to the cortex.

A mesh becomes a probability measure (:func:`surface`, :func:`empirical`, :func:`varifold`), and a loss compares two
measures (:func:`sliced_wasserstein`, :func:`chamfer`, :func:`wasserstein`, :func:`sinkhorn_divergence`). What is listed
here is what most people need. The rooms below (``meshot.mesh``, ``meshot.loss``, ``meshot.flow`` and so on) show more.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = "0.1.0"
