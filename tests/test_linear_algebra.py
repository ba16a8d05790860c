"""The small linear algebra against NumPy and Pinocchio."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.linear_algebra import (
    add_cross,
    add_rows,
    cholesky,
    larger,
    multiply,
    rotate,
    rotate_back,
    rotation_of,
    solve,
    solve_columns_transposed,
    solve_transposed,
    turn_of,
)

seeds = st.integers(0, 10_000)
angles = st.one_of(
    st.floats(0.0, math.pi - 1e-3), st.sampled_from([0.0, 1e-12, 1e-7, 1e-6, 2e-6, 1e-4])
)


def positive_definite(rng, n):
    root = rng.normal(size=(n, n))
    return root @ root.T + 0.1 * np.eye(n)


@given(seeds, st.integers(1, 8))
def test_the_factor_of_cholesky_is_numpys(seed, n):
    A = positive_definite(np.random.default_rng(seed), n)
    U = np.zeros((n + 1, n + 1))
    assert cholesky(np.triu(A), U)
    np.testing.assert_allclose(np.triu(U[:n, :n]), np.linalg.cholesky(A).T, atol=1e-10)
    assert cholesky(A, A)  # in place
    np.testing.assert_array_equal(np.triu(A), np.triu(U[:n, :n]))


@pytest.mark.parametrize("diagonal", [0.0, -1.0, math.nan])
@pytest.mark.parametrize("place", [0, 2])
def test_what_is_not_positive_definite_has_no_factor(diagonal, place):
    A = np.eye(3)
    A[place, place] = diagonal
    assert not cholesky(A, np.zeros((3, 3)))


@given(seeds, st.integers(1, 8))
def test_triangular_systems_are_solved(seed, n):
    rng = np.random.default_rng(seed)
    A, b = positive_definite(rng, n), rng.normal(size=n)
    U, x, y = np.linalg.cholesky(A).T.copy(), b.copy(), b.copy()
    solve(U, x)
    solve_transposed(U, y)
    np.testing.assert_allclose(U @ x, b, atol=1e-9)
    np.testing.assert_allclose(U.T @ y, b, atol=1e-9)
    B = np.column_stack((b, 2.0 * b, rng.normal(size=n)))
    X = B.copy()
    solve_columns_transposed(U, X)
    np.testing.assert_allclose(U.T @ X, B, atol=1e-9)


@given(
    seeds, st.sampled_from((1.0, -1.0)), st.integers(0, 9), st.integers(1, 6), st.integers(0, 5)
)
def test_rows_are_added_one_after_the_other(seed, sign, k, n, first):
    """Whether some are taken together or not, in the order in which a plain loop adds them."""
    rng = np.random.default_rng(seed)
    factors, rows, out = (
        rng.normal(size=k),
        rng.normal(size=(k + 1, first + n)),
        rng.normal(size=n),
    )
    expected = out.copy()
    for factor, row in zip(factors, rows[:k], strict=True):
        expected += sign * factor * row[first:]
    add_rows(sign, factors, rows, first, out)
    np.testing.assert_array_equal(out, expected)


@given(seeds)
def test_products_are_numpys(seed):
    rng = np.random.default_rng(seed)
    R, v, out = rng.normal(size=(3, 3)), rng.normal(size=3), np.empty(3)
    rotate(R, v, out)
    np.testing.assert_allclose(out, R @ v, atol=1e-12)
    rotate_back(R, v, out)
    np.testing.assert_allclose(out, R.T @ v, atol=1e-12)
    a, before = rng.normal(size=3), out.copy()
    add_cross(a, v, -0.7, out)
    np.testing.assert_allclose(out, before - 0.7 * np.cross(a, v), atol=1e-12)
    A, B, product = rng.normal(size=(2, 4)), rng.normal(size=(4, 3)), np.empty((2, 3))
    multiply(A, B, product)
    np.testing.assert_allclose(product, A @ B, atol=1e-12)


@given(seeds, angles)
def test_rotations_and_their_vectors_are_pinocchios(seed, angle):
    axis = np.random.default_rng(seed).normal(size=3)
    turn, R, back = angle * axis / np.linalg.norm(axis), np.empty((3, 3)), np.empty(3)
    rotation_of(turn, R)
    np.testing.assert_allclose(R, pin.exp3(turn), atol=1e-12)
    turn_of(R, back)
    np.testing.assert_allclose(back, turn, atol=1e-12)
    np.testing.assert_allclose(back, pin.log3(R), atol=1e-7)


@given(seeds, st.sampled_from([0.0, 1e-12, 1e-8, 1e-4]))
def test_no_angle_close_to_half_a_turn_is_special(seed, less):
    axis = np.random.default_rng(seed).normal(size=3)
    turn, R = (math.pi - less) * axis / np.linalg.norm(axis), np.empty((3, 3))
    rotation_of(turn, R)
    back, again = np.empty(3), np.empty((3, 3))
    turn_of(R, back)
    assert np.linalg.norm(back) <= math.pi + 1e-12
    rotation_of(back, again)
    np.testing.assert_allclose(again, R, atol=1e-12)


@pytest.mark.parametrize(
    ("a", "b", "expected"), [(1.0, 2.0, 2.0), (2.0, 1.0, 2.0), (math.inf, 0.0, math.inf)]
)
def test_the_larger_number(a, b, expected):
    assert larger(a, b) == expected


@pytest.mark.parametrize(("a", "b"), [(math.nan, 1.0), (1.0, math.nan)])
def test_nothing_is_larger_than_what_is_not_a_number(a, b):
    assert math.isnan(larger(a, b))
