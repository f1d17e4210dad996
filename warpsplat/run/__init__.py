"""One image from source to file: the public functions, and what they share."""
