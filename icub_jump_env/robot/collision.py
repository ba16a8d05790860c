"""Collision shapes of the links, for contacts of the robot with itself."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

Point = tuple[float, float, float]


class Capsule(NamedTuple):
    """Everything within ``radius`` of a segment.

    Attributes:
        start, end: Ends of the segment, in the link frame (m).
        radius: m.
    """

    start: Point
    end: Point
    radius: float


def _both_sides(*pairs: tuple[str, str]) -> tuple[tuple[str, str], ...]:
    """Pairs of links, each followed by its mirror image."""
    swap = {"l_": "r_", "r_": "l_"}

    def mirrored(link: str) -> str:
        return swap.get(link[:2], link[:2]) + link[2:]

    return tuple(pair for a, b in pairs for pair in ((a, b), (mirrored(a), mirrored(b))))


LINK_PAIRS: tuple[tuple[str, str], ...] = (
    *_both_sides(
        ("root_link", "l_upper_leg"),
        ("root_link", "l_upper_arm"),
        ("root_link", "l_forearm"),
        ("root_link", "l_hand"),
        ("chest", "l_upper_leg"),
        ("l_upper_leg", "l_upper_arm"),
        ("l_upper_leg", "l_forearm"),
        ("l_upper_leg", "l_hand"),
        ("l_lower_leg", "l_forearm"),
        ("l_lower_leg", "l_hand"),
        ("l_upper_leg", "r_lower_leg"),
        ("l_foot", "r_lower_leg"),
    ),
    ("l_upper_leg", "r_upper_leg"),
    ("l_lower_leg", "r_lower_leg"),
    ("l_foot", "r_foot"),
    ("l_forearm", "r_forearm"),
    ("l_hand", "r_hand"),
)
"""What can meet in a jump; neighbours at a joint overlap in any posture."""

CAPSULES: Mapping[str, tuple[Capsule, ...]] = MappingProxyType(
    {
        "root_link": (
            Capsule((0.040, 0.003, -0.085), (0.018, 0.042, -0.032), 0.071),
            Capsule((0.040, -0.003, -0.085), (0.018, -0.042, -0.032), 0.071),
        ),
        "chest": (
            Capsule((-0.098, 0.106, -0.087), (-0.015, 0.003, 0.015), 0.064),
            Capsule((0.098, 0.106, -0.087), (0.015, 0.003, 0.015), 0.064),
        ),
        "l_upper_leg": (
            Capsule((0.022, 0.012, 0.029), (0.023, -0.001, -0.102), 0.044),
            Capsule((-0.003, 0.000, 0.010), (0.009, 0.003, -0.111), 0.057),
        ),
        "r_upper_leg": (
            Capsule((0.022, -0.012, 0.029), (0.023, 0.001, -0.102), 0.044),
            Capsule((-0.003, 0.000, 0.010), (0.009, -0.003, -0.111), 0.057),
        ),
        "l_lower_leg": (Capsule((0.005, 0.003, -0.009), (-0.007, 0.004, -0.172), 0.055),),
        "r_lower_leg": (Capsule((0.005, -0.003, -0.009), (-0.007, -0.004, -0.172), 0.055),),
        "l_foot": (Capsule((0.087, 0.003, 0.001), (-0.025, -0.003, -0.004), 0.042),),
        "r_foot": (Capsule((0.087, -0.003, 0.001), (-0.025, 0.003, -0.004), 0.042),),
        "l_upper_arm": (Capsule((-0.019, -0.001, 0.057), (-0.016, -0.006, -0.011), 0.051),),
        "r_upper_arm": (Capsule((-0.019, 0.001, 0.057), (-0.016, 0.006, -0.011), 0.051),),
        "l_forearm": (Capsule((0.007, -0.002, -0.010), (0.069, 0.001, 0.018), 0.038),),
        "r_forearm": (Capsule((-0.007, -0.002, -0.010), (-0.069, 0.001, 0.018), 0.038),),
        "l_hand": (
            Capsule((0.018, 0.000, 0.044), (0.066, -0.004, 0.093), 0.015),
            Capsule((0.009, 0.003, -0.006), (0.128, 0.009, 0.020), 0.018),
        ),
        "r_hand": (
            Capsule((-0.018, 0.000, 0.044), (-0.066, -0.004, 0.093), 0.015),
            Capsule((-0.009, 0.003, -0.006), (-0.128, 0.009, 0.020), 0.018),
        ),
    }
)
"""By link. Fitted to the convex hulls of the meshes of iCubGenova04 by
``experiments.collision_shapes``: 3 to 10 mm off where links are close."""

TOLERANCE = 0.005
"""Shapes that overlap by less (m) need not stand for links that do."""
