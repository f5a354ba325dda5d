"""Run one function over many items: here, in processes beside this one, or on a cluster.

Results come as they are finished, each with its item. The function must be picklable and its result must
depend on the item only; then it does not matter where and in which order it ran, or that a worker died and
another one did its work again.
"""

from __future__ import annotations

import pickle
import signal
import socket
import threading
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import cv2

from .._arrays import integer, positive
from ..errors import ArgumentError, MissingExtraError, StateError

Item = TypeVar("Item")
Result = TypeVar("Result")

_PAUSE = 0.02  # between two looks at the cluster [s]


def run(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    *,
    workers: int = 1,
    scheduler: str | None = None,
    timeout: float = 10.0,
) -> Generator[tuple[Item, Result], None, None]:
    """Yield (item, function(item)) for every item, in the order in which they are finished.

    Args:
        function: picklable unless it runs in this process.
        items: picklable likewise.
        workers: 1 runs in this process, more in so many processes of joblib's pool, which stays warm for the
            next call.
        scheduler: address of a Dask scheduler, e.g. 'tcp://10.0.0.1:8786'; its workers run the function, and
            ``workers`` is not used.
        timeout: how long [s] to wait for the scheduler and for the first of its workers.

    Closing the iterator, also by Ctrl-C, cancels what has not been finished.

    Raises:
        Whatever the function raises, as soon as it does.
        StateError: a worker process was killed, the scheduler does not answer, or it has no workers.
        MissingExtraError: joblib or distributed is not installed.
    """
    workers, timeout = integer("workers", workers, at_least=1), positive("timeout", timeout)
    if scheduler is not None:
        return _on_cluster(function, items, scheduler, timeout)
    if workers > 1:
        return _in_processes(function, items, workers)
    return ((item, function(item)) for item in items)


@dataclass(frozen=True)
class _Task(Generic[Item, Result]):
    """The function as a worker runs it: on one thread, deaf to Ctrl-C, with errors that can be sent."""

    function: Callable[[Item], Result]

    def __call__(self, item: Item) -> tuple[Item, Result]:
        cv2.setNumThreads(1)
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # this process is ended by the one that started it
        try:
            return item, self.function(item)
        except Exception as error:
            raise _portable(error) from None


def _portable(error: Exception) -> Exception:
    """``error`` if it survives being pickled, else a StateError with its words."""
    try:
        copy = pickle.loads(pickle.dumps(error))
    except Exception:
        copy = None
    if type(copy) is type(error) and str(copy) == str(error):
        return error
    return StateError(f"worker: {type(error).__name__}: {error}")


def _in_processes(
    function: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> Generator[tuple[Item, Result], None, None]:
    try:
        import joblib
        from joblib.externals.loky.process_executor import BrokenProcessPool
    except ImportError:
        raise MissingExtraError("work in several processes", "learn") from None

    task = _Task(function)

    def results() -> Generator[tuple[Item, Result], None, None]:
        with joblib.parallel_config(backend="loky", inner_max_num_threads=1):
            parallel = joblib.Parallel(
                n_jobs=workers, return_as="generator_unordered", batch_size=1, pre_dispatch="2*n_jobs"
            )
            finished = parallel(joblib.delayed(task)(item) for item in items)
        try:
            for result in finished:  # noqa: UP028 - "yield from" would close it without the filter below
                yield result
        except BrokenProcessPool as error:
            raise StateError(f"workers: a worker process ended early: {error}") from None
        finally:
            with warnings.catch_warnings():  # of tasks that are cancelled, which is what closing is for
                warnings.simplefilter("ignore", UserWarning)
                finished.close()

    return results()


def _on_cluster(
    function: Callable[[Item], Result], items: Sequence[Item], address: str, timeout: float
) -> Generator[tuple[Item, Result], None, None]:
    try:
        import distributed
    except ImportError:
        raise MissingExtraError("work on a cluster", "scale") from None

    connect: Any = distributed.Client

    def results() -> Generator[tuple[Item, Result], None, None]:
        _knock(address, timeout)
        try:
            client: Any = connect(address, timeout=timeout, set_as_default=False)
        except Exception as error:  # what does not speak Dask may make it raise anything
            raise _silent(address, error) from None
        with client:
            yield from _gathered(client, _Task(function), items, address, timeout)

    return results()


def _knock(address: str, timeout: float) -> None:
    """Make sure that something listens at the address: a client that finds nobody may never end."""
    from distributed.comm.addressing import get_address_host_port

    place_of: Any = get_address_host_port
    try:
        place = place_of(address, strict=True)
    except ValueError as error:
        raise ArgumentError(f"scheduler: an address as tcp://10.0.0.1:8786 expected, got {error}") from None
    try:
        with socket.create_connection(place, timeout=timeout) as line:
            if not address.startswith("tls"):
                line.recv(1)  # the scheduler is the first to speak
    except OSError as error:
        raise _silent(address, error) from None


def _silent(address: str, error: Exception) -> StateError:
    return StateError(f"scheduler: {address} does not answer ({error}); does 'dask scheduler' run there?")


def _gathered(
    client: Any, task: _Task[Item, Result], items: Sequence[Item], address: str, timeout: float
) -> Generator[tuple[Item, Result], None, None]:
    import distributed
    from distributed.comm.core import CommClosedError

    try:
        client.wait_for_workers(1, timeout=timeout)
    except (TimeoutError, OSError):
        raise StateError(
            f"scheduler: {address} has no workers; start one there with 'dask worker {address}'"
        ) from None
    futures = client.map(task, items, pure=False)
    gone = (distributed.KilledWorker, distributed.CancelledError, CommClosedError)
    try:
        for future, result in _as_finished(client, futures, address, timeout):
            yield result
            future.release()
    except gone as error:
        raise StateError(f"workers: the cluster of {address} gave up: {error}") from None
    finally:
        client.cancel(futures)


def _as_finished(
    client: Any, futures: Sequence[Any], address: str, timeout: float
) -> Iterator[tuple[Any, Any]]:
    """(future, result) as they are finished; without workers Dask would wait for them for ever."""
    import distributed

    as_completed: Any = distributed.as_completed
    finished = as_completed(futures, loop=client.loop, with_results=True)
    pause, waited = threading.Event(), 0.0
    while not finished.is_empty():
        if finished.has_ready():
            future, result = next(finished)
            if future.status == "cancelled":
                raise StateError(f"scheduler: {address} is gone")
            yield future, result
            waited = 0.0
            continue
        pause.wait(_PAUSE)
        waited += _PAUSE
        if waited > timeout:
            if client.status != "running" or not client.scheduler_info()["workers"]:
                raise StateError(f"scheduler: {address} has lost all its workers, or is gone itself")
            waited = 0.0
