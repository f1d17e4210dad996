"""An extension of the vector editor Inkscape, and the command that installs it."""
