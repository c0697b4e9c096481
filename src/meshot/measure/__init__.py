"""Probability measures made from shapes."""
