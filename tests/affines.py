"""Affines that find mistakes: one with all axes askew, one that mirrors."""

import numpy as np

OBLIQUE = np.array([[1.2, 0.3, 0.1, -10], [-0.4, 0.9, 0.2, 5], [0.1, -0.3, 1.5, 7], [0, 0, 0, 1]])
FLIPPED = np.array([[-1.0, 0, 0, 30], [0, 1, 0, -4], [0, 0, 2, 1], [0, 0, 0, 1]])
