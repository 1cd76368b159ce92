"""The same jobs on the workers of a Dask scheduler: for more than one machine. An extra: `pip install levbench[dask]`.

Nothing is shared but the connection: the rig file travels with the jobs, and recordings stay where they were made, which
is nowhere once the rig is done.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

from bench import __version__, catalogue
from bench.cli.campaign.job import run_rig
from bench.cli.campaign.tasks import RigTask
from bench.errors import ConfigError
from bench.rigfile import RigFile

CONNECT_S = 10


@dataclass(frozen=True)
class Luggage:
    """What a worker elsewhere needs beside the job: the rig file's and its DBC's bytes by their names, our version, and
    the procedures that there are."""

    rig: bytes
    rig_name: str
    dbc: bytes
    dbc_name: str
    version: str
    procedures: tuple[Any, ...]  # entries of the catalogue


def packed(rig: RigFile) -> Luggage:
    """The luggage of a rig.

    Raises:
        ConfigError: its DBC does not lie in its own folder or below, by its name or by where a link leads.
    """
    path, name = Path(rig.path), PurePosixPath(rig.link.dbc)
    inside = (path.parent / name).resolve().is_relative_to(path.parent.resolve())
    if name.is_absolute() or ".." in name.parts or not inside:
        raise ConfigError(
            f"rig file {path}: dbc: found {name}; expected, for --scheduler, a file in the rig file's folder"
        )
    return Luggage(path.read_bytes(), path.name, (path.parent / name).read_bytes(), str(name), __version__,
                   catalogue.PROCEDURES)  # fmt: skip


def run_rig_here(task: RigTask, seed: int, luggage: Luggage) -> dict[str, Any]:
    """What a worker does.

    Raises:
        ConfigError: it has another version of Levbench.
    """
    if luggage.version != __version__:
        raise ConfigError(f"a worker has Levbench {__version__}; expected {luggage.version}, as here")
    catalogue.PROCEDURES = luggage.procedures
    with tempfile.TemporaryDirectory(prefix="levbench-") as folder:
        rig, dbc = Path(folder) / luggage.rig_name, Path(folder) / luggage.dbc_name
        dbc.parent.mkdir(parents=True, exist_ok=True)
        rig.write_bytes(luggage.rig)
        dbc.write_bytes(luggage.dbc)
        return run_rig(replace(task, rig=str(rig), folder=folder, keep="none"), seed)


class _Packing(Executor):
    """Dask's executor, with the luggage added to every job."""

    def __init__(self, base: Executor, luggage: Luggage) -> None:
        self._base, self._luggage = base, luggage

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Any:
        task, seed = args
        return self._base.submit(run_rig_here, task, seed, self._luggage)


@contextmanager
def workers_of(address: str, rig: RigFile) -> Iterator[tuple[Executor, int]]:
    """The workers of a scheduler as a pool, and how many there are.

    Raises:
        ConfigError: Dask is not installed, the scheduler does not answer, or it has no workers that will do.
    """
    try:
        import distributed
    except ImportError as error:
        raise ConfigError("--scheduler: Dask is not installed. Next: `pip install levbench[dask]`") from error
    luggage = packed(rig)
    try:
        dask: Any = distributed  # its functions are not annotated
        client = dask.Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"--scheduler {address}: no answer ({error}); expected the address that `dask scheduler` prints, as tcp://HOST:8786"
        ) from error
    try:
        threads = [int(worker["nthreads"]) for worker in client.scheduler_info(n_workers=-1)["workers"].values()]
        _check(address, threads)
        yield _Packing(client.get_executor(pure=False, retries=2), luggage), len(threads)
    finally:
        client.close()


def _check(address: str, threads: Sequence[int]) -> None:
    if not threads:
        raise ConfigError(
            f"--scheduler {address}: has no workers. Next: `dask worker {address} --nthreads 1 --nworkers N`"
        )
    if max(threads) > 1:
        raise ConfigError(
            f"--scheduler {address}: found a worker with {max(threads)} threads; expected one process per core. "
            f"Next: `dask worker {address} --nthreads 1 --nworkers N`"
        )
