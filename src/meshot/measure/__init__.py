"""Meshes as probability measures: the encodings that a loss takes.

A surface is a continuous measure (:func:`surface`), a sample of points (:func:`empirical`) or an oriented varifold
(:func:`varifold`: barycentres and normals, weighted by area). Weights are at least 0 and sum to one. Points are in
units of the vertices, in R³, or in R⁶ with normals.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
