"""Measurements of surfaces against each other, made without our own losses: the ruler is not made by the tailor."""
