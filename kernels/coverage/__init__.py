"""Models of coverage: how much of each pixel a shape covers."""
