"""Training of networks, with validation, checkpoints and exact resumption.

A training consists of a plan (steps, learning rates, validation) and a task (the loss of a step, a validation). It
keeps the best and the last weights, a log, and a state from which a stopped training resumes with the same result. The
default device is the GPU if there is one, else the CPU.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
