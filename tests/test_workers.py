"""One function over many items: here, in processes, on a cluster; whoever dies, the result is the same."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

import worker_functions as functions
from motorprime import ArgumentError, ArgumentTypeError, StateError
from motorprime.errors import MissingExtraError
from motorprime.learning.workers import run

pytestmark = pytest.mark.learn

SQUARES = {x: x * x for x in range(20)}
SCALE = pytest.mark.scale
HERE = Path(__file__).parent


def wait_for(condition):
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline, "it never came"
        time.sleep(0.01)


# In this process.


def test_here_every_item_comes_with_its_result_in_order():
    assert list(run(functions.square, range(20))) == list(SQUARES.items())
    assert list(run(functions.process_of, [0])) == [(0, os.getpid())]


def test_here_a_function_need_not_be_picklable_and_errors_are_its_own():
    assert list(run(lambda x: x + 1, [1, 2])) == [(1, 2), (2, 3)]
    with pytest.raises(functions.Stubborn, match="no because of reasons"):
        list(run(functions.fail_stubbornly, [1]))


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"workers": 0}, ArgumentError, "workers: expected an integer >= 1, got 0"),
        ({"workers": 1.5}, ArgumentTypeError, "workers: expected an integer"),
        ({"timeout": 0.0}, ArgumentError, "timeout: expected a number > 0"),
    ],
)
def test_options_that_make_no_sense_are_named_before_anything_runs(options, error, words):
    with pytest.raises(error, match=words):
        run(functions.square, [1], **options)


@pytest.mark.parametrize(
    ("module", "options", "extra"),
    [("joblib", {"workers": 2}, "learn"), ("distributed", {"scheduler": "tcp://127.0.0.1:9"}, "scale")],
)
def test_without_an_extra_the_error_says_what_to_install(monkeypatch, module, options, extra):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=rf"pip install 'motorprime\[{extra}\]'"):
        run(functions.square, [1], **options)


# In processes beside this one.


def test_processes_give_the_same_as_here():
    found = list(run(functions.square, range(20), workers=2))
    assert len(found) == 20 and dict(found) == SQUARES


def test_nothing_to_do_is_done_at_once():
    for workers in (1, 2):
        assert list(run(functions.square, [], workers=workers)) == []


def test_the_pool_s_processes_are_others_and_stay_for_the_next_call():
    first, second = ({pid for _, pid in run(functions.process_of, range(40), workers=2)} for _ in range(2))
    assert os.getpid() not in first | second
    assert len(first | second) <= 2


def test_opencv_and_blas_get_one_thread_in_each_process():
    assert {count for _, count in run(functions.opencv_threads, range(4), workers=2)} == {1}
    assert {count for _, count in run(functions.blas_threads, range(4), workers=2)} == {"1"}


def test_an_error_in_a_process_comes_with_its_class_and_words():
    with pytest.raises(ArgumentError, match="x: 2 is not to my liking"):
        list(run(functions.fail, range(4), workers=2))
    with pytest.raises(StateError, match="worker: Stubborn: no because of reasons"):
        list(run(functions.fail_stubbornly, range(4), workers=2))
    assert dict(run(functions.square, range(20), workers=2)) == SQUARES  # the pool has survived


def test_a_process_that_is_killed_is_an_error_and_the_next_call_has_a_new_one():
    with pytest.raises(StateError, match="workers: a worker process ended early"):
        list(run(functions.die, range(4), workers=2))
    assert dict(run(functions.square, range(20), workers=2)) == SQUARES


def test_closing_the_iterator_cancels_what_has_not_begun(tmp_path):
    for options in ({}, {"workers": 2}):
        folder = tmp_path / str(len(options))
        folder.mkdir()
        results = run(functions.Touch(folder), range(200), **options)
        next(results)
        results.close()
        assert 1 <= len(list(folder.iterdir())) < 100


@pytest.mark.parametrize("workers", [1, 2])
def test_ctrl_c_ends_everything_with_nothing_but_the_interrupt(tmp_path, workers):
    """Sent to the whole group, as a terminal does it."""
    script = (
        "import worker_functions as f, pathlib, sys\n"
        "from motorprime.learning.workers import run\n"
        "if __name__ == '__main__':\n"
        "    try:\n"
        f"        list(run(f.Touch(pathlib.Path('.'), slowly=True), range(10**4), workers={workers}))\n"
        "    except KeyboardInterrupt:\n"
        "        sys.exit(130)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-W", "error", "-c", script],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE), *sys.path[1:]])},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    wait_for(lambda: len(list(tmp_path.iterdir())) > 5)
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (130, "")
    with pytest.raises(ProcessLookupError):  # nobody of its group is left
        wait_for(lambda: os.killpg(process.pid, 0))


# On a cluster.


@contextmanager
def scheduler_with(workers, folder):
    """A real scheduler with worker processes: its address and those processes."""
    where = folder / "scheduler.json"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE), *sys.path[1:]])}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment, "cwd": folder}
    found = ["--scheduler-file", str(where), "--no-dashboard"]
    single = ["--nworkers", "1", "--nthreads", "1", "--no-nanny"]
    with ExitStack() as ending:

        def start(*arguments):
            process = subprocess.Popen([sys.executable, "-m", "dask", *arguments, *found], **quiet)
            ending.callback(process.wait)
            ending.callback(process.kill)
            return process

        start("scheduler", "--port", "0", "--host", "127.0.0.1")
        started = [start("worker", *single) for _ in range(workers)]
        wait_for(where.exists)
        yield json.loads(where.read_text())["address"], started


@SCALE
def test_a_cluster_gives_the_same_and_a_killed_worker_s_item_is_done_by_another(tmp_path):
    with scheduler_with(2, tmp_path) as (address, workers):
        killer = threading.Thread(target=kill_the_trapped, args=(tmp_path,))
        killer.start()
        found = list(run(functions.SquareOnce(tmp_path, 7), range(20), scheduler=address))
        killer.join()
        assert len(found) == 20 and dict(found) == SQUARES
        wait_for(lambda: any(worker.poll() == -signal.SIGKILL for worker in workers))
        with pytest.raises(ArgumentError, match="x: 2 is not to my liking"):
            list(run(functions.fail, range(4), scheduler=address))
        with pytest.raises(StateError, match="worker: Stubborn: no because of reasons"):
            list(run(functions.fail_stubbornly, range(4), scheduler=address))


def kill_the_trapped(folder):
    wait_for((folder / "trap").exists)
    os.kill(int((folder / "trap").read_text()), signal.SIGKILL)


@SCALE
def test_a_cluster_that_loses_its_last_worker_is_an_error_not_a_wait_for_ever(tmp_path):
    with scheduler_with(1, tmp_path) as (address, _):
        killer = threading.Thread(target=kill_the_trapped, args=(tmp_path,))
        killer.start()
        with pytest.raises(StateError, match=f"scheduler: {address} has lost all its workers"):
            list(run(functions.SquareOnce(tmp_path, 7), range(20), scheduler=address, timeout=3.0))
        killer.join()


@SCALE
def test_a_scheduler_without_workers_is_an_error(tmp_path):
    with (
        scheduler_with(0, tmp_path) as (address, _),
        pytest.raises(StateError, match=f"scheduler: {address} has no workers"),
    ):
        list(run(functions.square, range(3), scheduler=address, timeout=1.0))


@SCALE
def test_a_scheduler_that_does_not_answer_is_an_error():
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(StateError, match=f"scheduler: {address} does not answer"):
            list(run(functions.square, range(3), scheduler=address, timeout=0.5))


@SCALE
def test_something_else_that_listens_there_is_an_error():
    with socket.create_server(("127.0.0.1", 0)) as deaf:
        address = f"tcp://127.0.0.1:{deaf.getsockname()[1]}"
        with pytest.raises(StateError, match=f"scheduler: {address} does not answer"):
            list(run(functions.square, range(3), scheduler=address, timeout=0.5))


@SCALE
@pytest.mark.parametrize("address", ["", "nowhere", "carrier-pigeon://1.2.3.4:5"])
def test_an_address_that_is_none_is_an_error(address):
    with pytest.raises(
        ArgumentError, match=r"scheduler: an address as tcp://10\.0\.0\.1:8786 expected, got "
    ):
        list(run(functions.square, range(3), scheduler=address, timeout=0.5))
