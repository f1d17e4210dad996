"""Batches: many images, named on the command line or in YAML files, each made once.

file.py, layers.py: YAML and flags -> settings;  images.py: names, folders, patterns -> images;  plan.py: all
of that -> jobs;  manifest.py: what was made, and who makes what;  results.py: which results exist;  run.py:
do the jobs;  executors/: where they are done;  options.py, command.py, display.py: the command;
reports.py, index.py: pages.
"""
