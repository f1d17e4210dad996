"""The renderer again: plain, slow, float64, one formula after the other; gradients by torch autograd.

One file a stage, as in the renderer. It shares with the kernels the constants and what is planned before
drawing (pieces of each cubic; stations, rows and reach of each grid: integers and detached), nothing else.
Image sizes of a few dozen pixels.
"""

import torch

torch.set_default_dtype(torch.float64)
torch.set_num_threads(1)  # its arrays are small: threads would only wait for one another
