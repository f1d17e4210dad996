"""SVG: written, checked, read, drawn by resvg."""
