"""Executors, which do the images of a batch: in this process, in others, or on a cluster.

An executor takes tasks (``tasks.Task``) and yields outcomes (``tasks.Outcome``); both are small and can be
pickled. ``work.do`` does one task, in any process.  serial.py: in this process, one after the other;
pool.py: in several processes, which run worker.py;  ray.py: on a Ray cluster, which runs ray_actor.py.
"""
