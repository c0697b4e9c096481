"""Faces that cross along a flow: counting, bounds on the step, and repair.

A flow with a small step cannot make points cross; triangles can cross all the same. Here are the checks along a path,
the Lipschitz constants behind the bounds, and the repair of a carried surface.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
