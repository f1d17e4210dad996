"""The contents of pages that show results."""
