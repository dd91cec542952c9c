"""A matrix that grows: columns are put behind others without a copy, and nobody writes over another one's."""

import gc
import pickle
import weakref

import numpy as np
import pytest

from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.evidence.grown import NOT_GROWN, Grown, chosen

RNG = np.random.default_rng(3)


def columns(number: int) -> np.ndarray:
    return RNG.normal(size=(20, number))


def test_columns_go_into_the_room_behind_the_others():
    first = NOT_GROWN.beside(columns(4), columns(1))
    kept, more = first.columns.copy(), columns(2)
    second = first.beside(first.columns, more)
    assert np.shares_memory(first.columns, second.columns)
    np.testing.assert_array_equal(second.columns, np.hstack([kept, more]))
    np.testing.assert_array_equal(first.columns, kept)


def test_two_that_go_on_from_the_same_columns_do_not_share_what_is_new():
    begun = NOT_GROWN.beside(columns(4), columns(1))
    kept, one, other = begun.columns.copy(), columns(1), columns(1)
    first, second = begun.beside(begun.columns, one), begun.beside(begun.columns, other)
    np.testing.assert_array_equal(first.columns, np.hstack([kept, one]))
    np.testing.assert_array_equal(second.columns, np.hstack([kept, other]))


def test_other_columns_than_those_of_the_memory_are_copied():
    begun, here, more = NOT_GROWN.beside(columns(4), columns(1)), columns(5), columns(1)
    np.testing.assert_array_equal(begun.beside(here, more).columns, np.hstack([here, more]))
    # The first three columns of the memory: what comes behind them must not go over the fourth.
    kept = begun.columns.copy()
    np.testing.assert_array_equal(begun.beside(begun.columns[:, :3], more).columns, np.hstack([kept[:, :3], more]))
    np.testing.assert_array_equal(begun.columns, kept)


def test_more_columns_than_there_is_room_for():
    begun, more = NOT_GROWN.beside(columns(1), columns(1)), columns(100)
    kept = begun.columns.copy()
    np.testing.assert_array_equal(begun.beside(begun.columns, more).columns, np.hstack([kept, more]))


def test_the_memory_stays_in_its_process():
    begun = NOT_GROWN.beside(columns(4), columns(1))
    assert pickle.loads(pickle.dumps(begun)) == Grown()


def test_chosen_columns_are_each_in_one_piece():
    W = np.asfortranarray(columns(6))
    some = chosen(W, np.array([4, 1]))
    np.testing.assert_array_equal(some, W[:, [4, 1]])
    assert some.flags["F_CONTIGUOUS"]


@pytest.mark.parametrize("turned", [np.s_[::-1], np.s_[:, ::-1], np.s_[5:]])
def test_rows_and_columns_in_another_order_are_not_those_of_the_memory(turned):
    begun = NOT_GROWN.beside(columns(4), columns(2))
    here = begun.columns[turned]
    more = RNG.normal(size=(len(here), 1))
    np.testing.assert_array_equal(begun.beside(here, more).columns, np.hstack([here, more]))


def test_an_evidence_of_fewer_columns_leaves_the_wide_matrix(bench):
    """A search keeps evidences of few columns for long."""
    wide = bench.fit().evidence([registry.get("accel_quadratic")]).with_effects([registry.get("gyro_delay")])
    memory = weakref.ref(wide.grown.memory.whole)
    few = wide.only(np.array([len(wide.weight) + 1]))
    first = wide.only(np.arange(len(wide.weight), len(wide.weight) + 2))
    assert few.grown == NOT_GROWN
    assert first.grown == wide.grown
    del wide, first
    gc.collect()
    assert memory() is None
