"""Records: named numbers and arrays in one block of memory.

In Python the arrays are attributes, views of the block. To a compiled function a record is one
argument, whatever it holds: it takes the ``block``, and ``block[0]`` has the same attributes.
"""

from __future__ import annotations

import functools
from typing import Annotated, Any, get_type_hints

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Block = Any
"""(1,) structured array; in a compiled function its element has the record's fields."""

Number = Annotated[float, ()]
Vector = Annotated[Array, (3,)]
Rotation = Annotated[Array, (3, 3)]
PerJoint = Annotated[Array, ("n",)]


class Record:
    """Its fields are what a subclass annotates with a shape.

    Shapes have numbers and names of sizes; the latter are given at construction.

    Attributes:
        block: (1,) structured array with all fields.
    """

    block: Block

    def __init_subclass__(cls) -> None:
        for name, shape in _shapes(cls):
            if not shape:
                setattr(cls, name, _number(name))

    def __init__(self, sizes: dict[str, int] | None = None, /, **values: Any) -> None:
        """Make a record of zeros.

        Args:
            sizes: Sizes by name.
            values: Fields that do not begin at zero.
        """
        kind: Any = type(self)
        self._bind(np.zeros(1, _dtype(kind, tuple((sizes or {}).items()))))
        for name, value in values.items():
            self.block[name][0] = value

    def _bind(self, block: Block) -> None:
        vars(self)["block"] = block
        for name in block.dtype.names:
            if block.dtype[name].shape:
                vars(self)[name] = block[name][0]

    def __setattr__(self, name: str, value: Any) -> None:
        # Whoever sets a field means what is in the block.
        block = vars(self).get("block")
        if block is not None and name in block.dtype.names:
            block[name] = value
        else:
            object.__setattr__(self, name, value)

    def __getstate__(self) -> dict[str, Any]:
        # A copy takes views of its own block.
        names = self.block.dtype.names
        return {name: value for name, value in vars(self).items() if name not in names}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._bind(self.block)


def _shapes(record: type[Record]) -> list[tuple[str, tuple[int | str, ...]]]:
    hints = get_type_hints(record, include_extras=True)
    return [
        (name, shape)
        for name, hint in hints.items()
        for shape in getattr(hint, "__metadata__", ())
    ]


def _number(name: str) -> property:
    return property(lambda record: float(record.block[name][0]))


@functools.cache
def _dtype(record: type[Record], sizes: tuple[tuple[str, int], ...]) -> np.dtype[np.void]:
    known: dict[int | str, int | str] = dict(sizes)
    fields = [
        (name, np.float64, tuple(known.get(size, size) for size in shape))
        for name, shape in _shapes(record)
    ]
    return np.dtype(fields, align=True)
