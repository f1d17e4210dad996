"""Where the images of a batch are made: in this process, in others of this machine, or on a Ray cluster.

An ``Executor`` (tasks.py) takes tasks and yields their outcomes, which can be pickled.  work.py: do one task;
local.py: one after the other, here;  pool.py: in processes of this machine;  ray.py: on a cluster.
"""
