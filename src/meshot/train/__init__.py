"""Training: one engine for every network, with validation, checkpoints and exact resume.

A training is a plan (steps, rates, validation) and a task (the loss of a step, a validation); the engine keeps the best
and the last weights, a log, and a state from which a stopped training goes on with the same result. A device that is
left out is the accelerator if there is one, else the processor. Configurations are read here too.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
