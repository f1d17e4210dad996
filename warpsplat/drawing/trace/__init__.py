"""Drawings: an image of flat regions -> a scene of one path a region, sub-pixel sharp."""
