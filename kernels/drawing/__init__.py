"""Least squares of drawings' outlines: on the CPU, in double precision, on arrays of the host.

A **sample** lies on a cubic, at ``t``, and says where the image has the outline: its ``place``, the unit
vector ``across`` the outline, and the ``weight`` of the square of its distance along that vector. Samples are
sorted by cubic; those of cubic ``i`` are the range from ``first[i]`` to ``first[i + 1]``. The control points
of cubic ``i`` are ``cubics[4 i]`` to ``cubics[4 i + 3]``.
"""
