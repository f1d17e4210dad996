"""Where the images of a batch are done: in this process, by others, or wherever an ``Executor`` does them.

An executor is given tasks (``tasks.Task``) and yields what became of them (``tasks.Outcome``); both are small
and can be pickled. ``work.do`` does one, in whatever process.  serial.py: in this one, one after the other;
pool.py: in several, whose side is worker.py;  ray.py: on a Ray cluster, whose side is ray_actor.py.
"""
