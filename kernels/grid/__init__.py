"""Shapes -> grids of Gaussians (the paper's model)."""
