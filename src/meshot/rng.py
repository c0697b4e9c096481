"""Random number generation: one seeded NumPy generator, held by the caller.

NumPy's generators give the same stream on every CPU. ``torch.randn`` does not, because its vectorised and plain code
differ. With NumPy, stored notebook outputs agree between machines.
"""

import numpy as np
import torch

Generator = np.random.Generator | torch.Generator | int


def numpy_generator(generator: Generator) -> np.random.Generator:
    """A NumPy generator from a seed, a NumPy generator, or a torch generator."""
    if isinstance(generator, np.random.Generator):
        return generator
    if isinstance(generator, torch.Generator):
        seed = torch.randint(2**62, (), generator=generator, device=generator.device)
        return np.random.default_rng(int(seed))
    if isinstance(generator, int | np.integer) and not isinstance(generator, bool) and generator >= 0:
        return np.random.default_rng(int(generator))
    raise ValueError(
        f"generator is {generator!r}; a seed (an integer >= 0), a numpy.random.Generator or a torch.Generator is "
        "needed: pass, say, generator=0"
    )
