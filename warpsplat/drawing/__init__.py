"""Drawings, line art and pixel art: traced, fitted and tidied."""
