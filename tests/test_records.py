"""Records: fields by name, one block of memory, copies of their own."""

import copy
import pickle
from typing import Annotated

import numpy as np
import pytest

from icub_jump_env.compiled import compiled
from icub_jump_env.records import Array, Block, Number, PerJoint, Record, Vector


class Load(Record):
    """A record with a number, and arrays of known and of named size."""

    mass: Number
    place: Vector
    share: PerJoint
    rows: Annotated[Array, (2, "n")]


@compiled
def lift(load: Block, height: float) -> float:
    """Move a load; its weight."""
    record = load[0]
    record.place[2] += height
    record.mass *= 2.0
    return record.mass * 9.81 + record.rows[1, 2]


def load():
    return Load({"n": 3}, mass=5.0, place=(1.0, 2.0, 3.0), rows=7.0)


def test_fields_hold_what_they_were_given_and_else_zero():
    made = load()
    assert (made.mass, type(made.mass)) == (5.0, float)
    np.testing.assert_array_equal(made.place, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(made.share, np.zeros(3))
    np.testing.assert_array_equal(made.rows, np.full((2, 3), 7.0))


def test_compiled_functions_see_and_change_the_fields():
    made = load()
    made.place[0] = -1.0
    made.share = np.arange(3.0)
    assert lift(made.block, 0.5) == pytest.approx(2 * 5.0 * 9.81 + 7.0)
    assert made.mass == 10.0
    np.testing.assert_array_equal(made.place, [-1.0, 2.0, 3.5])
    np.testing.assert_array_equal(made.share, [0.0, 1.0, 2.0])


@pytest.mark.parametrize("copier", [copy.deepcopy, lambda made: pickle.loads(pickle.dumps(made))])
def test_a_copy_has_a_block_of_its_own_whose_fields_are_its_attributes(copier):
    made = load()
    made.note = "not a field"
    twin = copier(made)
    assert twin.note == "not a field"
    assert twin.block.tobytes() == made.block.tobytes()
    lift(twin.block, 1.0)
    twin.share[:] = 4.0
    assert (twin.mass, twin.place[2], twin.block["share"][0, 1]) == (10.0, 4.0, 4.0)
    assert (made.mass, made.place[2], made.share[1]) == (5.0, 3.0, 0.0)


def test_what_is_no_field_or_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="weight"):
        Load({"n": 3}, weight=1.0)
    with pytest.raises(ValueError, match="broadcast"):
        Load({"n": 3}, share=np.zeros(4))
