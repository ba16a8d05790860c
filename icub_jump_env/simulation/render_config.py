"""How pictures are taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from icub_jump_env.checks import check_choice, check_count, store

RenderMode = Literal["rgb_array", "human"]
CameraName = Literal["side", "front", "profile"]


@dataclass(frozen=True)
class RenderConfig:
    """Pictures.

    Attributes:
        mode: None, rgb_array or human.
        width: Of a picture (pixels).
        height: Of a picture (pixels).
        camera: Where they are taken from.

    Raises:
        ConfigError: If a value is out of range.
    """

    mode: RenderMode | None = None
    width: int = 640
    height: int = 480
    camera: CameraName = "side"

    def __post_init__(self) -> None:
        check_choice("render_mode", self.mode, (None, *get_args(RenderMode)))
        store(self, width=check_count("width", self.width, 16, 1920, "pixels"))
        store(self, height=check_count("height", self.height, 16, 1080, "pixels"))
        check_choice("camera", self.camera, get_args(CameraName))
