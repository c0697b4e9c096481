"""Systems that deform initial surfaces: Algorithm 1 of the paper, with any loss.

One network per hemisphere computes a velocity from image and position. Its flow moves the initial white surface to the
true one. A system of this kind is a subclass of :class:`DeformationSystem` that sets its loss.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
