"""Line art to strokes: ink, its skeleton, centre lines with widths, pens, and the order of a plotter."""
