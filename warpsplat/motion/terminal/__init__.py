"""Show images in terminals."""
