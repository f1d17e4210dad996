"""Kernels of the two models of Gaussians: shapes -> grids of Gaussians -> coverages, and the adjoints."""
