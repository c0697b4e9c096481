"""Images with an affine: reading, topology, and surfaces of constant value."""
