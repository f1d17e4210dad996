"""``warpsplat serve``: a page on this machine that vectorizes images; needs the extra ``serve``.

Requests pass ``guard.py`` (access control) to ``app.py``. ``form.py`` has the table of the form's controls.
``store.py`` holds images and runs in memory, within limits. ``worker.py`` does one run after the other by
``warpsplat.vectorize``, a draft first, and ``live.py`` takes its progress. Nothing is written to a disk.
There is one user, whose pages all show the same.
"""
