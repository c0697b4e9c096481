"""White matter of both hemispheres: the network's use, its data, its training, its surface."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
