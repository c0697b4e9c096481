from .frank_wolfe import unbalanced_sliced as unbalanced_sliced
from .line_by_line import sliced_partial as sliced_partial, sliced_unbalanced as sliced_unbalanced
