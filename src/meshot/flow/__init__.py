"""Motion: descent of free points, velocity fields, their integration, and fitting."""
