"""Work on a Dask cluster, through joblib. Inputs and outputs lie where every worker finds them."""

import logging
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Future
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import vdet
from vdet.errors import ClusterError

if TYPE_CHECKING:
    from distributed import Client

_PATIENCE = 10  # seconds for the scheduler to answer, and for a first worker to be there


@contextmanager
def on_cluster(address: str) -> Iterator[None]:
    """Let `joblib.Parallel` work on the cluster whose scheduler is at `address`.

    Raises
    ------
    ClusterError
        Dask is not installed, the scheduler does not answer, it has no worker, a worker has not
        this version of vdet, or the scheduler ends while there is work.

    A task whose workers are killed time and again raises `concurrent.futures.BrokenExecutor`, as
    one does whose process is killed on this machine.
    """
    import joblib

    with _connected(address) as client:
        _check_workers(client, address)
        try:
            with joblib.parallel_config(_backend(client)):
                yield
        except CancelledError as error:
            raise ClusterError(
                f"{address}: the scheduler has ended; start it again, and run this again"
            ) from error


@contextmanager
def _connected(address: str) -> "Iterator[Client]":
    try:
        from distributed import Client
        from distributed.versions import VersionMismatchWarning
    except ImportError as error:
        raise ClusterError(
            '--scheduler needs Dask, which is not installed; pip install "vdet[dask]"'
        ) from error
    # A lost connection is told by an exception, and a wrong version of vdet is looked for below.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", VersionMismatchWarning)
        try:
            client = Client(address, timeout=_PATIENCE, set_as_default=False)  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as error:  # an address of another form is a ValueError
            raise ClusterError(
                f"{address}: no Dask scheduler answers there; start one with `dask scheduler`"
            ) from error
    with client:
        yield client


def _backend(client: "Client") -> Any:
    """Return joblib's Dask backend, mended: it would wait for ever for a task that Dask gave up."""
    from distributed import KilledWorker
    from joblib._dask import DaskDistributedBackend

    class Backend(DaskDistributedBackend):  # type: ignore[misc]
        def submit(self, func: Any, callback: Callable[[Any], object]) -> "Future[Any]":
            def tell(future: "Future[Any]") -> None:
                if error := future.exception():
                    callback(error)

            future: Future[Any] = super().submit(func, callback)
            future.add_done_callback(tell)
            return future

        def retrieve_result_callback(self, out: Any) -> Any:
            if isinstance(out, KilledWorker):
                raise BrokenExecutor(str(out)) from out
            if isinstance(out, BaseException):
                raise out
            return super().retrieve_result_callback(out)

    return Backend(client=client)


def _check_workers(client: "Client", address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError as error:
        raise ClusterError(
            f"{address}: the scheduler has no worker; start some with `dask worker {address}`"
        ) from error
    for worker, version in client.run(_version, on_error="return").items():
        if version != vdet.__version__:
            had = f"vdet {version}" if isinstance(version, str) else f"no vdet ({version})"
            raise ClusterError(
                f"{worker}: this worker has {had}, here is vdet {vdet.__version__}; install the "
                "same everywhere"
            )


def _version() -> str:
    return vdet.__version__
