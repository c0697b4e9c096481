from .files import PAGE as PAGE
from .files import reconstructed as reconstructed
