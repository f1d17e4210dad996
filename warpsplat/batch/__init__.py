"""Batches: many images, found by their names or by YAML files, each made once.

file.py, layers.py: YAML and flags -> settings;  images.py: names, folders, patterns -> images;  names.py:
what results are called;  plan.py: all of that -> jobs;  manifest.py: what was made, and who makes what now;
run.py: doing the jobs;  totals.py: figures of all of them.
"""
