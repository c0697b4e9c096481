from .files import OVERVIEW as OVERVIEW, PAGE as PAGE, write_reconstruction as write_reconstruction
