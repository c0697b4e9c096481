"""Training: one engine for every network, with validation, checkpoints and exact resume.

A training is a plan (steps, rates, validation), a loss of a step and a validation; the engine keeps the best weights,
a log, and a state from which a stopped training goes on with the same result. Configurations are read here too.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
