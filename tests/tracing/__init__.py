"""Kernels that say what they read, write and compute: for a test of races, and to count a step."""
