"""Arithmetic with the same bits on every processor.

NumPy, OpenCV, BLAS and the C library choose their code by the processor they run on, and the choices differ
in last bits: NumPy's ``exp`` with AVX-512 and with AVX2, products of matrices with and without fused
multiply-adds, the order in which ``argsort`` leaves equal keys. A last bit decides which shape goes first,
and from there a fit becomes another one. So nothing between an image and the bytes of its file calls those.
It calls these, which are made of what IEEE 754 rounds correctly everywhere (``+ - * /`` and square roots),
in an order that is written down, and of integer arithmetic.

What remains of NumPy: elementwise ``+ - * /``, ``sqrt``, comparisons, rounding, ``ldexp`` and ``frexp``;
sums, means, variances and ``cumsum``, whose order is the same on all processors; ``sort``, stable
``argsort``, medians and quantiles; ``x**2``. Of OpenCV: what works on integers or only compares (labels,
contours, morphology, drawing of masks, medians). ``tests/test_portable_calls.py`` names what is forbidden,
and where.
"""
