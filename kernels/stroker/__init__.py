"""Centre lines of strokes -> polygons whose union is the stroke, with caps, joins and dashes (SVG 1.1, 11.4).

Each piece of a segment, from dash end to dash end, becomes a quadrilateral; each join that these do not make
by themselves a wedge between them; each end a cap. All wind the same way, so that their winding-weighted
areas add up to 1 or more where the stroke is, and the coverage of a fill, clamped, is that of the union.
Pixels on the border of two overlapping polygons would count twice; so neighbours meet on the bisector of
their angle, on the inner side of the turn and, for mitres and turns that are too small to see, on the outer
one too, wherever the pieces are long enough: where the line bends less than the width. Caps overlap where a
gap between dashes is shorter than the width: pixels on the border of both get too much coverage.
"""
