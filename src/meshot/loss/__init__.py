"""Losses between measures, differentiable in the supports and in the weights."""
