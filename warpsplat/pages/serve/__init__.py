"""``warpsplat serve``: a page on this machine that vectorizes images; needs the extra ``serve``.

Requests pass ``guard.py`` (access control) to ``app.py``. ``store.py`` holds the sessions of open pages in
memory, within limits. ``worker.py`` does one run after the other by ``warpsplat.vectorize``, and
``live.py`` takes its progress. Nothing is written to a disk.
"""
