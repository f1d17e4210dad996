"""The bounding boxes of labels."""

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, bounding_boxes


def test_boxes_hold_all_pixels_of_a_label_and_no_empty_lines() -> None:
    labels = np.full((6, 7), NO_REGION, np.int32)
    labels[1:3, 2:6] = 0
    labels[4, 0] = labels[2, 6] = 1
    boxes = bounding_boxes(labels, 2)
    assert boxes == [(2, 1, 6, 3), (0, 2, 7, 5)]
    assert labels[boxes[0].slices()].tolist() == [[0] * 4] * 2
