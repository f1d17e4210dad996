"""Mutated and made-up inputs against the whole command line.

A short run is part of the suite (``test_short_run.py``, ``test_properties.py``); a long one is
``python -m tests.fuzz --count 100000 --seed N``; ``python -m tests.fuzz.kills`` ends runs at random moments.
"""
