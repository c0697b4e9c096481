"""Velocity fields: analytic fields, cubic B-splines on a grid, small networks; and their storage in files.

A field is a function of a time in [0, 1] and of points. It returns velocities in units of the points per unit of time.
A :class:`LearnedVelocity` has parameters that can be fitted.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
