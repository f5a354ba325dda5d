"""Native libraries are silenced at the file descriptor, and everything is as before afterwards."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from motorprime.silence import silenced


def test_what_is_written_past_python_is_lost_and_what_comes_before_and_after_is_not(capfd):
    print("before")
    with silenced(1):
        os.write(1, b"native\n")
        os.write(2, b"kept\n")
    print("after")
    sys.stdout.flush()
    assert capfd.readouterr() == ("before\nafter\n", "kept\n")


def test_both_streams_are_restored_when_the_block_fails(capfd):
    with pytest.raises(RuntimeError, match="oops"), silenced(1, 2):
        os.write(1, b"native\n")
        os.write(2, b"native\n")
        raise RuntimeError("oops")
    os.write(1, b"out\n")
    os.write(2, b"err\n")
    assert capfd.readouterr() == ("out\n", "err\n")


def test_no_descriptor_is_left_open():
    descriptors = Path("/proc/self/fd")
    if not descriptors.is_dir():
        pytest.skip("this system does not list open descriptors in /proc")
    count = len(list(descriptors.iterdir()))
    for _ in range(5):
        with silenced(1, 2):
            pass
    assert len(list(descriptors.iterdir())) == count


def test_a_closed_descriptor_is_already_silent():
    spare = os.dup(1)
    os.close(spare)
    with silenced(spare):
        pass
    with pytest.raises(OSError):
        os.fstat(spare)
