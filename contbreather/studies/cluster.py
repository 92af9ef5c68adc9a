"""A Dask cluster as an executor."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from contbreather.errors import BadInput

PATIENCE = 5  # seconds until a scheduler that does not answer is given up


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The executor of the cluster with this scheduler.

    Raises
    ------
    BadInput
        If the extra is not installed, or nothing answers.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise BadInput(
            "a cluster needs dask: pip install 'contbreather[cluster]', here and on its workers"
        ) from error
    try:
        client = distributed.Client(address, timeout=PATIENCE)
    except (OSError, TimeoutError, ValueError) as error:
        raise BadInput(
            f"no cluster answers at {address}: {error}; start one with `dask scheduler` and "
            "`dask worker ADDRESS`"
        ) from error
    with client:
        yield client.get_executor(pure=False)
