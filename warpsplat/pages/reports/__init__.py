"""Pages that show results: what they show is put together here, what they look like is in ``pages``."""
