from .files import PAGE as PAGE
from .files import write_reconstruction as write_reconstruction
