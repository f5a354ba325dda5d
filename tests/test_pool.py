"""Landscapes that nobody holds any more serve again, and only those."""

import gc

import numpy as np
import pytest

from motorprime.landscape import gaussian_landscape, kernel_landscape, kernel_landscapes

SHAPE = (200, 150)


def landscape(place, shape=SHAPE):
    return kernel_landscape([[float(place), 60.0]], shape, width=20.0)


def address(array):
    return array.__array_interface__["data"][0]


def test_a_dropped_landscape_s_memory_serves_again():
    first = landscape(50)
    place = address(first)
    del first
    # Without the pool the allocator would give the memory to whoever comes first.
    others = [np.empty(SHAPE, np.float32) for _ in range(20)]
    assert all(address(other) != place for other in others)
    assert address(landscape(70)) == place


@pytest.mark.parametrize(
    "held",
    [
        lambda a: a,
        lambda a: a[3:9, ::2],
        lambda a: a.T[:1],
        lambda a: a.view(np.uint32),
        lambda a: memoryview(a),
        lambda a: {"deep": [a[0]]},
        lambda a: np.broadcast_to(a, (2, *a.shape)),
        lambda a: a.flat,
    ],
)
def test_whatever_shares_a_landscape_s_memory_holds_it(held):
    original = landscape(50)
    place, kept = address(original), held(original)
    del original
    others = [landscape(k) for k in range(30)]
    assert all(address(other) != place for other in others)
    del kept


def test_landscapes_that_are_held_are_never_written_again():
    held = [landscape(k) for k in range(30)]
    copies = [each.copy() for each in held]
    pair = kernel_landscapes([[[5.0, 5.0]], [[100.0, 90.0]]], SHAPE, width=20.0)
    assert pair[0] is not pair[1] and not np.shares_memory(*pair)
    for each, copy in zip(held, copies, strict=True):
        np.testing.assert_array_equal(each, copy)
    assert len({address(each) for each in [*held, *pair]}) == 32


def test_a_landscape_in_a_cycle_of_references_is_held_until_it_is_collected():
    cycle = {"landscape": landscape(50)}
    cycle["self"] = cycle
    place = address(cycle["landscape"])
    gc.disable()
    try:
        del cycle
        assert address(landscape(60)) != place
    finally:
        gc.enable()


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("spoil", ["read-only", "reshaped", "transposed", "reinterpreted"])
def test_a_landscape_that_was_changed_in_kind_does_not_come_back_so(spoil):
    for k in range(20):
        array = landscape(k)
        if spoil == "read-only":
            array.flags.writeable = False
        elif spoil == "reshaped":
            array.shape = (SHAPE[0] * SHAPE[1],)
        elif spoil == "reinterpreted":
            array.dtype = np.int32
        else:
            array.strides = array.strides[::-1]
        del array
    new = landscape(50)
    assert new.shape == SHAPE and new.flags.c_contiguous and new.flags.writeable and new.dtype == np.float32


def test_sizes_do_not_mix():
    for shape in [(200, 150), (150, 200), (300, 100), (200, 150)] * 4:
        assert landscape(50, shape).shape == shape
        assert gaussian_landscape([50.0, 60.0], [9.0, 0.0, 9.0], shape).shape == shape


def test_a_stale_landscape_shows_nowhere():
    full = gaussian_landscape([70.0, 90.0], [1e3, 0.0, 1e3], SHAPE)
    assert full.all()
    del full
    one = landscape(50)
    assert not one[:39].any() and not one[81:].any()
