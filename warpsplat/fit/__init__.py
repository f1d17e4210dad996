"""The optimisation of a scene against an image."""
