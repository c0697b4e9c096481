"""Figures and players, one room for each part of the book."""
