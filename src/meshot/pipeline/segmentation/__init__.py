"""Segmentation of the white matter of both hemispheres: data, training, application, initial surfaces."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
