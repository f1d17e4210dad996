"""Python runs this file in each process whose environment asks for the test device."""

import os

if os.environ.get("WARPSPLAT_FAKE_CUDA"):
    from tests.fake_cuda.install import install

    install()
