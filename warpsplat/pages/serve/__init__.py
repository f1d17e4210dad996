"""``warpsplat serve``: a page on this machine that vectorizes what is dropped on it; the extra ``serve``.

Requests come to ``app.py``, past ``guard.py`` (who may ask); ``store.py`` holds what pages gave and what was
made of it, in memory and within ``limits.py``; ``worker.py`` does one run after the other by
``warpsplat.vectorize``, ``live.py`` says how far it is; ``events.py`` tells the page. Nothing is written to a
disk.
"""
