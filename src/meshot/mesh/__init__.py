"""Shapes: triangle meshes and contours, their geometry, topology, sampling, analytic examples and files."""
