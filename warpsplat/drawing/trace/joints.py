"""What each point of a traced outline is, so that an optimiser can keep it that."""

FREE = 0
"""A handle of a curve."""

CORNER = 1
"""A point on the outline where it may turn sharply."""

SMOOTH = 2
"""A point on the outline whose two handles lie on one line through it."""

LINE_HANDLE = 3
"""A handle of a straight line, at a third of it."""

ALONE = -1
"""In ``same``: a point that no other shape shares."""
