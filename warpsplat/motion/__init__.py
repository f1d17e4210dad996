"""Animations of a run: its training, or its shapes drawn one after the other; and previews in terminals."""
