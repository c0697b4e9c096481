"""Self-intersection of meshes under a flow: detection, bounds on the step size, and repair.

A flow with small steps is injective on points, but the triangles between moving vertices can still intersect. This
subpackage counts such faces along a flow, computes the Lipschitz constants in the bounds, and repairs moved surfaces.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
