"""Run one function over many items: here, in processes beside this one, or on a cluster.

Results come as they are finished, each with its item. The function must be picklable and its result must
depend on the item only; then it does not matter where and in which order it ran, or that a worker died and
another one did its work again.
"""

from __future__ import annotations

import pickle
import signal
import threading
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import cv2

from .._arrays import integer, positive
from ..errors import ArgumentError, Error, MissingExtraError, StateError

Item = TypeVar("Item")
Result = TypeVar("Result")


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
            yield from finished
        except BrokenProcessPool as error:
            raise StateError(f"workers: a worker process ended early: {error}") from None
        finally:
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
        try:
            client: Any = connect(address, timeout=timeout, set_as_default=False)
        except ValueError as error:
            raise ArgumentError(f"scheduler: {address!r} is no address: {error}") from None
        except (OSError, TimeoutError):
            raise StateError(
                f"scheduler: {address} does not answer within {timeout:g} s; does 'dask scheduler' run there?"
            ) from None
        with client:
            yield from _gathered(client, _Task(function), items, address, timeout)

    return results()


def _gathered(
    client: Any, task: _Task[Item, Result], items: Sequence[Item], address: str, timeout: float
) -> Generator[tuple[Item, Result], None, None]:
    import distributed

    try:
        client.wait_for_workers(1, timeout=timeout)
    except (TimeoutError, OSError):
        raise StateError(
            f"scheduler: {address} has no workers; start one there with 'dask worker {address}'"
        ) from None
    as_completed: Any = distributed.as_completed
    futures = client.map(task, items, pure=False)
    try:
        for future in as_completed(futures):
            try:
                yield future.result()
            except Error:
                raise
            except (distributed.KilledWorker, distributed.CancelledError) as error:
                raise StateError(f"workers: the cluster gave up: {error}") from None
            future.release()
    finally:
        client.cancel(futures)
