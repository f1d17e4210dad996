"""Comparison with other programs, for developers: in the repository only, no part of the wheel."""
