"""A fuzzer for the whole command line, and properties that must hold for any input.

A short run is part of the suite; a long one is ``FUZZ=100000 python -m pytest tests/fuzz -k breaks``.
"""
