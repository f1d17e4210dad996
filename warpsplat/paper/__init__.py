"""The paper's two renderers: ``splat``, Gaussians that cover what a path covers, and ``gaussian``, soft ones.

models.py: the stages, from kernels/, grid.py and coverage.py;  renderers.py: what fits ask of them;
chains.py: scenes that they can show;  as_paths.py: soft shapes as paths;  split.py: strokes that fade.
"""
