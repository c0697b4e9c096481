"""Where randomness comes from: one seeded NumPy generator, held by the caller.

NumPy's generators give the same stream on every CPU, which ``torch.randn`` does not (its vectorised and plain code
paths differ), so stored notebook outputs agree between machines.
"""

import numpy as np
import torch

Generator = np.random.Generator | torch.Generator | int


def numpy_generator(generator: Generator) -> np.random.Generator:
    """A NumPy generator from a seed, a NumPy generator, or a torch generator.

    Parameters
    ----------
    generator : numpy.random.Generator, torch.Generator or int
        A NumPy generator is returned as it is, so that its stream goes on. A torch generator gives the seed (and
        advances by one draw). An integer is a seed.

    Returns
    -------
    numpy.random.Generator

    Raises
    ------
    ValueError
        For anything else, ``None`` included: randomness without a seed is not repeatable.
    """
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
