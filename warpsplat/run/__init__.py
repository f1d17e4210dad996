"""Run one image: from a source to the file and its score."""
