"""Outlines of drawings that stay clean while they are fitted.

Lines have their handles at the thirds, handles of smooth joints stay collinear, coordinates that are one
(points of several shapes, the ends of an upright line) stay equal, and pinned ones stay.

After an update the points are projected: handles are *aligned* at smooth joints, each *tie* takes its first
member's value, and handles are *laid* on lines. Before an update the gradient goes through the adjoint of
that, in reverse order. On points that keep the constraints this is exact, so that a fit ends where the loss
has no slope that the constraints leave.
"""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)

MIN_LENGTH = wp.constant(1.0e-6)  # [canvas units] shorter vectors have no direction
MIN_HANDLE = wp.constant(0.05)  # [canvas units] a handle of length 0 would have none, and the joint a corner


@wp.func
def along_joint(
    joint: wp.vec2,
    before: wp.vec2,
    after: wp.vec2,
    before_free: wp.bool,
    after_free: wp.bool,
) -> wp.vec2:
    """Return a unit vector along the outline at a smooth joint; zero where there is none.

    A line gives it. Of two free handles it is the axis from which they lie least apart, by squares.
    """
    back, ahead = joint - before, after - joint
    if not before_free:
        return wp.normalize(back)
    if not after_free:
        return wp.normalize(ahead)
    xx = back[0] * back[0] + ahead[0] * ahead[0]
    yy = back[1] * back[1] + ahead[1] * ahead[1]
    xy = back[0] * back[1] + ahead[0] * ahead[1]
    if xx + yy < MIN_LENGTH * MIN_LENGTH:
        return wp.vec2(0.0, 0.0)
    # The eigenvector of the larger eigenvalue, by the row that is not near zero.
    half = 0.5 * (xx - yy)
    root = wp.sqrt(half * half + xy * xy)
    axis = wp.vec2(half + root, xy)
    if half < 0.0:
        axis = wp.vec2(xy, root - half)
    if wp.dot(axis, back + ahead) < 0.0:
        axis = -axis
    return wp.normalize(axis)


@wp.kernel
def align(
    # In:
    offset: wp.int32,
    joint_point: wp.array[wp.int32],  # [joint_count] the point on the outline
    joint_before: wp.array[wp.int32],  # [joint_count] the handle before it, or where a line begins
    joint_after: wp.array[wp.int32],  # [joint_count] the handle after it, or where a line ends
    joint_free: wp.array[wp.int32],  # [joint_count] 1: the one before is a handle, 2: the one after, 3: both
    # Out:
    points: wp.array[wp.vec2],  # [point_count] updated [canvas units]
):
    """Project the handles of a smooth joint on its direction, none of them backwards; a thread a joint."""
    i = offset + wp.tid()
    j, k = joint_before[i], joint_after[i]
    before_free, after_free = joint_free[i] & 1 != 0, joint_free[i] & 2 != 0
    p = points[joint_point[i]]
    u = along_joint(p, points[j], points[k], before_free, after_free)
    if wp.length_sq(u) > 0.0:
        if before_free:
            points[j] = p - wp.max(wp.dot(p - points[j], u), MIN_HANDLE) * u
        if after_free:
            points[k] = p + wp.max(wp.dot(points[k] - p, u), MIN_HANDLE) * u


@wp.kernel
def align_backward(
    # In:
    offset: wp.int32,
    points: wp.array[wp.vec2],  # [point_count] that keep the constraints [canvas units]
    joint_point: wp.array[wp.int32],  # [joint_count]
    joint_before: wp.array[wp.int32],  # [joint_count]
    joint_after: wp.array[wp.int32],  # [joint_count]
    joint_free: wp.array[wp.int32],  # [joint_count]
    # Out:
    points_grad: wp.array[wp.vec2],  # [point_count] updated: of joints and their handles
    joint_turn: wp.array[wp.vec2],  # [joint_count] gradient for the far end of the line, if there is one
):
    """Adjoint of ``align``; a thread a joint.

    With unit vectors u along the outline and n across it, and handles at distances a before and b after:
    along u a handle is free. Across, all move with the point; and turning u by an angle t moves the handles
    by -a t n and b t n. Two free handles turn it by t = (a d + b e) / (a a + b b) where they lie d and e off;
    a line of length l by the distance that one end is moved across, over l.
    """
    i = offset + wp.tid()
    j, k = joint_before[i], joint_after[i]
    before_free, after_free = joint_free[i] & 1 != 0, joint_free[i] & 2 != 0
    p = points[joint_point[i]]
    u = along_joint(p, points[j], points[k], before_free, after_free)
    joint_turn[i] = wp.vec2(0.0, 0.0)
    if wp.length_sq(u) > 0.0:
        n = wp.vec2(-u[1], u[0])
        a, b = wp.dot(p - points[j], u), wp.dot(points[k] - p, u)
        along_j, along_k = wp.dot(points_grad[j], u), wp.dot(points_grad[k], u)
        across_j, across_k = wp.dot(points_grad[j], n), wp.dot(points_grad[k], n)
        g = points_grad[joint_point[i]]
        if before_free and after_free:
            torque = (b * across_k - a * across_j) / (a * a + b * b)
            g += (across_j + across_k + (a - b) * torque) * n
            points_grad[j] = along_j * u - a * torque * n
            points_grad[k] = along_k * u + b * torque * n
        elif after_free:  # behind a line of length a
            turn = across_k * b / a * n
            g += across_k * n + turn
            joint_turn[i] = -turn
            points_grad[k] = along_k * u
        else:  # before a line of length b
            turn = across_j * a / b * n
            g += across_j * n + turn
            joint_turn[i] = -turn
            points_grad[j] = along_j * u
        points_grad[joint_point[i]] = g


@wp.kernel
def turn_backward(
    # In:
    offset: wp.int32,
    turned_by: wp.array2d[wp.int32],  # [point_count, 2] joints whose line has its far end here, or NONE
    joint_turn: wp.array[wp.vec2],  # [joint_count] of ``align_backward``
    # Out:
    points_grad: wp.array[wp.vec2],  # [point_count] added to
):
    """Add the gradients that joints pass on to the far ends of their lines; a thread a point."""
    i = offset + wp.tid()
    g = points_grad[i]
    if turned_by[i, 0] != constants.NONE:
        g += joint_turn[turned_by[i, 0]]
    if turned_by[i, 1] != constants.NONE:
        g += joint_turn[turned_by[i, 1]]
    points_grad[i] = g


@wp.kernel
def lay(
    # In:
    offset: wp.int32,
    line_end: wp.array[wp.int32],  # [point_count] where the line that begins here ends, or NONE
    # Out:
    points: wp.array[wp.vec2],  # [point_count] updated: handles of lines [canvas units]
):
    """Put the handles of lines at their thirds; a thread a point."""
    i = offset + wp.tid()
    j = line_end[i]
    if j != constants.NONE:
        step = (points[j] - points[i]) / 3.0
        points[i + 1] = points[i] + step
        points[i + 2] = points[j] - step


@wp.kernel
def lay_backward(
    # In:
    offset: wp.int32,
    line_end: wp.array[wp.int32],  # [point_count] where the line that begins here ends, or NONE
    line_start: wp.array[wp.int32],  # [point_count] where the line that ends here begins, or NONE
    # Out:
    points_grad: wp.array[wp.vec2],  # [point_count] updated: of the ends of lines
):
    """Adjoint of ``lay``: ends get the shares of the handles; a thread a point."""
    i = offset + wp.tid()
    g = points_grad[i]
    if line_end[i] != constants.NONE:
        g += (2.0 * points_grad[i + 1] + points_grad[i + 2]) / 3.0
    j = line_start[i]
    if j != constants.NONE:
        g += (points_grad[j + 1] + 2.0 * points_grad[j + 2]) / 3.0
    if line_end[i] != constants.NONE or j != constants.NONE:
        points_grad[i] = g


@wp.kernel
def spread(
    # In:
    offset: wp.int32,
    tie_first: wp.array[wp.int32],  # [tie_count + 1]
    tie_member: wp.array[wp.int32],  # [member_count] 2 x point + axis
    # Out:
    value: wp.array2d[wp.float32],  # [point_count, 2] updated: points [canvas units]
):
    """Copy the value of a tie's first member to the others; a thread a tie."""
    i = offset + wp.tid()
    first = tie_member[tie_first[i]]
    x = value[first >> 1, first & 1]
    for m in range(tie_first[i] + 1, tie_first[i + 1]):
        member = tie_member[m]
        value[member >> 1, member & 1] = x


@wp.kernel
def spread_backward(
    # In:
    offset: wp.int32,
    tie_first: wp.array[wp.int32],  # [tie_count + 1]
    tie_member: wp.array[wp.int32],  # [member_count] 2 x point + axis
    # Out:
    grad: wp.array2d[wp.float32],  # [point_count, 2] updated: of points
):
    """Adjoint of ``spread``: the first member gets all, the others nothing; a thread a tie."""
    i = offset + wp.tid()
    total = float(0.0)
    for m in range(tie_first[i], tie_first[i + 1]):
        member = tie_member[m]
        total += grad[member >> 1, member & 1]
        grad[member >> 1, member & 1] = 0.0
    first = tie_member[tie_first[i]]
    grad[first >> 1, first & 1] = total


@wp.kernel
def share(
    # In:
    offset: wp.int32,
    tie_first: wp.array[wp.int32],  # [tie_count + 1]
    tie_member: wp.array[wp.int32],  # [member_count] 2 x point + axis
    tie_pinned: wp.array[wp.int32],  # [tie_count] 1: stays as it is
    # Out:
    grad: wp.array2d[wp.float32],  # [point_count, 2] updated: of points
):
    """Give all members of a tie their total gradient, so that they move as one; 0 if pinned. A thread a
    tie.
    """
    i = offset + wp.tid()
    total = float(0.0)
    if tie_pinned[i] == 0:
        for m in range(tie_first[i], tie_first[i + 1]):
            member = tie_member[m]
            total += grad[member >> 1, member & 1]
    for m in range(tie_first[i], tie_first[i + 1]):
        member = tie_member[m]
        grad[member >> 1, member & 1] = total
