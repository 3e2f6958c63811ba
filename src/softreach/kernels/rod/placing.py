"""Points and vectors taken from the frame of the base to the world, in place."""

from softreach.kernels.compiler import strict


@strict
def move(points, rotation, position):
    """Turn and move points (n, 3) in place; strict, as those without equilibrium are NaN.

    Args:
        points: To be overwritten, shape (n, 3).
        rotation: Matrix (3, 3).
        position: New place of the origin, shape (3,).
    """
    a, b, c = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    d, e, f = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    g, h, k = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    p, q, r = position[0], position[1], position[2]
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        points[i, 0] = a * x + b * y + c * z + p
        points[i, 1] = d * x + e * y + f * z + q
        points[i, 2] = g * x + h * y + k * z + r


@strict
def turn(vectors, rotation):
    """Turn vectors in place.

    Args:
        vectors: (n, 3 k, m), one above another in k threes, to be overwritten.
        rotation: Matrix (3, 3).
    """
    for i in range(vectors.shape[0]):
        for row in range(0, vectors.shape[1], 3):
            for j in range(vectors.shape[2]):
                x, y, z = vectors[i, row, j], vectors[i, row + 1, j], vectors[i, row + 2, j]
                for axis in range(3):
                    turned = rotation[axis, 0] * x + rotation[axis, 1] * y
                    vectors[i, row + axis, j] = turned + rotation[axis, 2] * z
