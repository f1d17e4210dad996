"""Arithmetic with the same bits on every processor.

NumPy, OpenCV, BLAS and the C library choose code by processor, and results differ in last bits: NumPy's
``exp`` with AVX-512 and with AVX2, matrix products with and without fused multiply-adds, the order of equal
keys from ``argsort``. A last bit decides which shape is removed first, and from there a fit diverges. So
nothing between an image and the bytes of its file calls those functions. The ones here use integers, and what
IEEE 754 rounds correctly everywhere (``+ - * /`` and square roots) in a fixed order.

NumPy may be used for elementwise ``+ - * /``, ``sqrt``, comparisons, rounding, ``ldexp`` and ``frexp``; for
sums, means, variances and ``cumsum``, whose order is the same on all processors; for ``sort``, stable
``argsort``, medians and quantiles; for ``x**2``. OpenCV may be used for integers and comparisons (labels,
contours, morphology, drawing of masks, medians). ``tests/test_portable_calls.py`` lists what is forbidden
where.
"""
