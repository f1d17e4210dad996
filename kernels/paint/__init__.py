"""Paints: flat colours, gradients and pictures."""
