"""Kernels that say what they read and write: for a test of races."""
