"""Kernels of signed distances."""
