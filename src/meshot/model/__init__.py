"""Neural networks for segmentation and deformation, and storage of their weights as safetensors.

Networks map tensors to tensors. The only files they read or write are their weights, which include a record of the
training.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
