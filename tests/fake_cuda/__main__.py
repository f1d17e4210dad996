"""Run Python with the test device: ``python -m tests.fake_cuda -m warpsplat vectorize photo.jpg``.

``WARPSPLAT_FAKE_CUDA='{"devices": 2}'`` chooses other options (``Options``). Broken rules are printed.
"""

import os
import sys
from dataclasses import replace

from tests.fake_cuda import environment, options

chosen = replace(options, log=options.log or "/dev/stderr")
os.execve(sys.executable, [sys.executable, *sys.argv[1:]], environment(chosen))
