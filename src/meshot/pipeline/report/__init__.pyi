from .files import PAGE as PAGE, write_reconstruction as write_reconstruction
