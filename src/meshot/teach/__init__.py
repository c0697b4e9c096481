"""Checkers for the exercises: each gives a hint, not just a verdict, and needs no network."""
