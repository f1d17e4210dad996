"""Animations of a run: how the shapes came to be, or in which order they are drawn."""
