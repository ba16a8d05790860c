"""What all pictures promise: axes say where they begin, colours differ for every reader."""

import itertools

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from icub_jump_env.evaluation.figures.style import (
    CONTENDERS,
    CONTROLLER,
    NOT_FROM_ZERO,
    name_origins,
    panels,
)

# Machado, Oliveira and Fernandes (2009): linear RGB as seen without one of the three cones.
SEEN = {
    "all cones": np.eye(3),
    "no long": [
        [0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998],
    ],
    "no middle": [
        [0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881],
    ],
    "no short": [
        [1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900],
    ],
}  # fmt: skip
TO_XYZ = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
WHITE = [0.9505, 1.0, 1.089]


def seen_as(color, matrix):
    """CIELAB coordinates, in which a distance of 2 is just seen."""
    rgb = np.array(to_rgb(color))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    x, y, z = TO_XYZ @ np.clip(matrix @ linear, 0.0, 1.0) / WHITE
    f = [np.cbrt(t) if t > 0.008856 else 7.787 * t + 16 / 116 for t in (x, y, z)]
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("colors", [CONTENDERS, tuple(CONTROLLER.values())])
@pytest.mark.parametrize("matrix", SEEN.values(), ids=SEEN)
def test_every_reader_tells_the_colours_apart(colors, matrix):
    for first, second in itertools.combinations(colors, 2):
        assert np.linalg.norm(seen_as(first, matrix) - seen_as(second, matrix)) > 16.0


def test_an_axis_without_zero_says_so_once():
    figure, ((near, far, nameless),) = panels((6.0, 2.0), columns=3)
    near.plot([0, 1], [-1, 1])
    far.plot([3, 4], [-5, -4])
    nameless.plot([3, 4], [3, 4])
    for axis in (near, far):
        axis.set(xlabel="x (m)", ylabel="y (m)")
    for _ in range(2):
        assert name_origins(figure) is figure
    assert (near.get_xlabel(), near.get_ylabel()) == ("x (m)", "y (m)")
    assert (far.get_xlabel(), far.get_ylabel()) == (
        f"x (m){NOT_FROM_ZERO}",
        f"y (m){NOT_FROM_ZERO}",
    )
    assert nameless.get_xlabel() == ""
