"""Random number generation: one seeded NumPy generator, held by the caller.

NumPy's generators give the same stream on every CPU. ``torch.randn`` does not, because its vectorised and plain code
differ. With NumPy, stored notebook outputs agree between machines.
"""

import numpy as np
import torch

Generator = np.random.Generator | torch.Generator | int


def numpy_generator(generator: Generator) -> np.random.Generator:
    """A NumPy generator from a seed, a NumPy generator, or a torch generator.

    Parameters
    ----------
    generator : numpy.random.Generator, torch.Generator or int
        A NumPy generator is returned unchanged, so that its stream continues. A torch generator provides the seed
        and advances by one draw. An integer is a seed.

    Returns
    -------
    numpy.random.Generator

    Raises
    ------
    ValueError
        For anything else, including ``None``: without a seed, results cannot be repeated.
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
