"""Golden results: the digests of small files, the same on every machine.

A change that means to change bytes updates them with ``python -m tests.golden --update``.
"""
