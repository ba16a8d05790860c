"""Small dense linear algebra for compiled functions: loops whose order of sums is fixed."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from icub_jump_env.compiled import compiled

Array = NDArray[np.float64]


@compiled
def larger(a: float, b: float) -> float:
    """The larger number; NaN if one of them is."""
    return a if a >= b or a != a else b


@compiled
def rotate(R: Array, v: Array, out: Array) -> None:
    """Set ``out`` to R v, for a (3, 3) rotation and a vector; it is none of the others."""
    for i in range(3):
        out[i] = R[i, 0] * v[0] + R[i, 1] * v[1] + R[i, 2] * v[2]


@compiled
def rotate_back(R: Array, v: Array, out: Array) -> None:
    """Set ``out`` to R^T v, likewise."""
    for i in range(3):
        out[i] = R[0, i] * v[0] + R[1, i] * v[1] + R[2, i] * v[2]


@compiled
def add_rows(sign: float, factors: Array, rows: Array, first: int, out: Array) -> None:
    """Add rows times their factors, one after the other.

    Four at a time, as it costs more to read and write ``out`` than to calculate.

    Args:
        sign: Of all factors, 1 or -1.
        factors: (k,) of the first k rows.
        rows: (k or more, m) of which the columns from ``first`` on count.
        first: Index.
        out: (n,) to which this adds the n entries of each row.
    """
    # Of an unsigned index it is clear that it does not count from the end.
    start, n, k = np.uintp(first), np.uintp(len(out)), len(factors)
    whole = k - k % 4
    for i in range(0, whole, 4):
        f0, f1 = sign * factors[i], sign * factors[i + 1]
        f2, f3 = sign * factors[i + 2], sign * factors[i + 3]
        for j in range(n):
            c = start + j
            two = (out[j] + f0 * rows[i, c]) + f1 * rows[i + 1, c]
            out[j] = (two + f2 * rows[i + 2, c]) + f3 * rows[i + 3, c]
    for i in range(whole, k):
        factor = sign * factors[i]
        for j in range(n):
            out[j] += factor * rows[i, start + j]


@compiled
def cholesky(A: Array, U: Array) -> bool:
    """Upper U with U^T U = A for the first rows and columns of ``U`` that ``A`` has.

    Args:
        A: (n, n) symmetric; its upper half is read.
        U: At least (n, n); may be ``A``.

    Returns:
        Whether A is positive definite; else U is of no use.
    """
    n = A.shape[0]
    for i in range(n):
        row = U[i, i:n]
        for j in range(n - i):
            row[j] = A[i, i + j]
        add_rows(-1.0, U[:i, i], U, i, row)
        if not row[0] > 0.0:
            return False
        scale = 1.0 / math.sqrt(row[0])
        for j in range(n - i):
            row[j] *= scale
    return True


@compiled
def solve_transposed(U: Array, b: Array) -> None:
    """Replace b, (n,), by U^-T b."""
    n = len(b)
    for i in range(n):
        b[i] /= U[i, i]
        factor = b[i]
        for j in range(i + 1, n):
            b[j] -= factor * U[i, j]


@compiled
def solve_columns_transposed(U: Array, B: Array) -> None:
    """Replace B, (n, k), by U^-T B."""
    for i in range(B.shape[0]):
        row = B[i]
        add_rows(-1.0, U[:i, i], B, 0, row)
        for j in range(B.shape[1]):
            row[j] /= U[i, i]


@compiled
def solve(U: Array, b: Array) -> None:
    """Replace b, (n,), by U^-1 b."""
    for i in range(len(b) - 1, -1, -1):
        value = b[i]
        for j in range(i + 1, len(b)):
            value -= U[i, j] * b[j]
        b[i] = value / U[i, i]


@compiled
def rotation_of(v: Array, R: Array) -> None:
    """Write into R, (3, 3), the rotation about v, (3,), by its length (rad)."""
    x, y, z = v[0], v[1], v[2]
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle > 1e-6:
        sine, versine = math.sin(angle) / angle, (1.0 - math.cos(angle)) / square
    else:
        sine, versine = 1.0 - square / 6.0, 0.5 - square / 24.0
    R[0, 0], R[0, 1], R[0, 2] = (
        1.0 - versine * (y * y + z * z), versine * x * y - sine * z, versine * x * z + sine * y,
    )  # fmt: skip
    R[1, 0], R[1, 1], R[1, 2] = (
        versine * x * y + sine * z, 1.0 - versine * (x * x + z * z), versine * y * z - sine * x,
    )  # fmt: skip
    R[2, 0], R[2, 1], R[2, 2] = (
        versine * x * z - sine * y, versine * y * z + sine * x, 1.0 - versine * (x * x + y * y),
    )  # fmt: skip


@compiled
def turn_of(R: Array, v: Array) -> None:
    """Write into v, (3,), the rotation vector (rad) of R, (3, 3), the shorter way."""
    # By its quaternion, from the largest of its entries, so that no angle is special.
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    largest = max(max(trace, R[0, 0]), max(R[1, 1], R[2, 2]))
    if largest == trace:
        w, x, y, z = 1.0 + trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    elif largest == R[0, 0]:
        w, x = R[2, 1] - R[1, 2], 1.0 + 2.0 * R[0, 0] - trace
        y, z = R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]
    elif largest == R[1, 1]:
        w, y = R[0, 2] - R[2, 0], 1.0 + 2.0 * R[1, 1] - trace
        x, z = R[0, 1] + R[1, 0], R[1, 2] + R[2, 1]
    else:
        w, z = R[1, 0] - R[0, 1], 1.0 + 2.0 * R[2, 2] - trace
        x, y = R[0, 2] + R[2, 0], R[1, 2] + R[2, 1]
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    length = math.sqrt(x * x + y * y + z * z)
    factor = 2.0 * math.atan2(length, w) / length if length > 1e-300 else 0.0
    v[0], v[1], v[2] = factor * x, factor * y, factor * z


@compiled
def multiply(A: Array, B: Array, out: Array) -> None:
    """Set ``out`` to A B, for small matrices; it is none of the others."""
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            value = 0.0
            for k in range(A.shape[1]):
                value += A[i, k] * B[k, j]
            out[i, j] = value


@compiled
def add_cross(a: Array, b: Array, factor: float, out: Array) -> None:
    """Add a factor times a x b to ``out``, (3,)."""
    out[0] += factor * (a[1] * b[2] - a[2] * b[1])
    out[1] += factor * (a[2] * b[0] - a[0] * b[2])
    out[2] += factor * (a[0] * b[1] - a[1] * b[0])
