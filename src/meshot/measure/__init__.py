"""Probability measures that represent meshes: the inputs of the losses.

A surface is encoded as a continuous measure (:func:`surface`), a random sample of points (:func:`empirical`) or an
oriented varifold (:func:`varifold`: barycentres and normals, weighted by area). Weights are non-negative and sum to
one. Points are in units of the vertices, in R³, or in R⁶ with normals.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
