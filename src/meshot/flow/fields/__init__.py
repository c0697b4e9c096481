"""Velocity fields: analytic ones, cubic B-splines on a grid, small networks; written and read.

A field is called with a time in [0, 1] and points, and returns velocities in units of the points. A
:class:`LearnedVelocity` has parameters that can be fitted.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
