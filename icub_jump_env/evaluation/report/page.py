"""What the HTML page of ``--report`` is made of, and how it is written."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2

from icub_jump_env.evaluation.episodes.rollout import Frame
from icub_jump_env.evaluation.figures.style import PAGE, Figure, page_colors, svg
from icub_jump_env.evaluation.quantities import commands


@dataclass(frozen=True)
class Picture:
    """What an ``img`` element needs.

    Attributes:
        uri: The picture itself, as a data URI.
        width: Natural width (CSS pixels).
        height: Natural height.
        alt: What it shows, for those who cannot see it.
        caption: What is written below it.
    """

    uri: str
    width: int
    height: int
    alt: str
    caption: str = ""


def data_uri(media_type: str, content: bytes) -> str:
    """The content as an address that holds it."""
    return f"data:{media_type};base64,{base64.b64encode(content).decode()}"


def photo(picture: Frame) -> str:
    """A rendered picture as a data URI."""
    import imageio.v3 as iio

    return data_uri("image/webp", iio.imwrite("<bytes>", picture, extension=".webp", quality=85))


def drawing(figure: Figure, alt: str, caption: str) -> Picture:
    """A figure that takes on the colour scheme of the page."""
    content, width, height = svg(figure)
    return Picture(data_uri("image/svg+xml", content), width, height, alt, caption)


def _typographic(text: str) -> str:
    """A number of a table with a true minus sign, or a true dash."""
    return "–" if text == "-" else text.replace("-", "−")  # noqa: RUF001


def render(**content: Any) -> str:
    """The page."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["typographic"] = _typographic
    environment.globals |= {"colors": PAGE, "page_colors": page_colors, "commands": commands}
    return environment.get_template("page.html").render(content)
