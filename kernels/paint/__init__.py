"""What shapes are coloured with."""
