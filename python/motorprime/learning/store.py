"""Samples on disk: a folder of Parquet parts that grows, survives being killed, and is queried with SQL.

manifest.json          what the samples are; see :mod:`motorprime.learning.manifest`
part-00000.parquet     samples 0 .. chunk - 1, with their index in column ``i``; and so on
.lock                  held by the one process that adds samples

A part is written beside its place and renamed, so it is there whole or not at all. Whatever is there after a
crash is therefore good, and what is missing is computed again; sample i depends on the seed and i only.
"""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .._arrays import integer
from ..errors import ArgumentError, MissingExtraError, NotInViewError, StateError
from ..samples import Samples
from .manifest import COUNT, GAP, INDEX, NUMBER, POINT, WORD, Manifest

Columns = dict[str, npt.NDArray[Any]]
MANIFEST, LOCK = "manifest.json", ".lock"


@dataclass(frozen=True)
class Piece:
    """Samples start .. stop - 1, all of one part, that are not there yet."""

    part: int
    start: int
    stop: int


class Store:
    """The samples of one folder; made by :meth:`open` or :meth:`create`.

    Attributes:
        folder: where it is.
        manifest: what the samples are.
    """

    def __init__(self, folder: Path, manifest: Manifest) -> None:
        self.folder, self.manifest = folder, manifest

    @classmethod
    def open(cls, folder: str | Path) -> Store:
        """The store in a folder.

        Raises:
            ArgumentError: there is none.
            MissingExtraError: pyarrow or duckdb is not installed.
        """
        _parquet(), _duckdb()
        folder = Path(folder)
        path = folder / MANIFEST
        try:
            text = path.read_text(encoding="utf-8")
        except FileNotFoundError:
            reason = f"has no {MANIFEST}" if folder.is_dir() else "does not exist"
            raise ArgumentError(f"folder: {folder} is no store of samples: it {reason}") from None
        except (OSError, ValueError) as error:
            raise ArgumentError(f"folder: cannot read {path}: {error}") from None
        return cls(folder, Manifest.from_json(text, str(path)))

    @classmethod
    def create(cls, folder: str | Path, manifest: Manifest) -> Store:
        """The store in a folder, made there if the folder is missing or empty.

        Raises:
            ArgumentError: the folder holds something else, or other samples: robot, seed, kind, version.
            MissingExtraError: pyarrow or duckdb is not installed.
        """
        _parquet(), _duckdb()
        folder = Path(folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            others = [path.name for path in folder.iterdir() if not path.name.startswith(".")]
            if not others:
                _write_whole(folder / MANIFEST, manifest.to_json().encode())
        except OSError as error:
            raise _cannot_write(folder, error) from None
        if others and MANIFEST not in others:
            raise ArgumentError(
                f"folder: {folder} is not empty and has no {MANIFEST}; choose a new or an empty folder"
            )
        store = cls.open(folder)
        store.manifest.check_same(manifest, str(folder))
        return store

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Be the one process that adds samples; what an interrupted one left half-written is removed.

        Raises:
            StateError: another process is adding samples to this folder.
        """
        try:
            handle = (self.folder / LOCK).open("w")
        except OSError as error:
            raise _cannot_write(self.folder, error) from None
        with handle:
            try:
                import fcntl  # not on Windows: there two writers are the user's business
            except ImportError:  # pragma: no cover
                pass
            else:
                try:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    raise StateError(
                        f"folder: another process is adding samples to {self.folder}; wait until it has ended"
                    ) from None
            for left in self.folder.glob(".*.tmp"):
                left.unlink(missing_ok=True)
            yield

    def __len__(self) -> int:
        """How many samples are there."""
        return sum(_rows(path) for _, path in self._parts())

    def missing(self, count: int) -> list[Piece]:
        """What has to be computed to hold samples 0 .. count - 1; every part there is read and checked.

        Raises:
            StateError: a part is damaged.
        """
        count, chunk = integer("count", count, at_least=0), self.manifest.chunk
        present = {part: len(self._load(part)) for part, _ in self._parts()}
        pieces = []
        for part, first in enumerate(range(0, count, chunk)):
            start, stop = first + present.get(part, 0), min(first + chunk, count)
            if start < stop:
                pieces.append(Piece(part, start, stop))
        return pieces

    def write(self, part: int, columns: Mapping[str, npt.ArrayLike]) -> None:
        """Add samples to a part, following those it has; all of them are on disk afterwards, or none.

        Args:
            part: its number, from 0.
            columns: the index ``i`` (n,) and all columns of the manifest, (n,) each.

        Raises:
            ArgumentError: missing or unknown columns, NaN or infinity where a number is due, wrong indices.
            StateError: the disk is full; parts that were finished are kept.
        """
        arrow, parquet = _arrow(), _parquet()
        part = integer("part", part, at_least=0)
        table = self._checked(columns)
        first = part * self.manifest.chunk
        path = self._path(part)
        if path.exists():
            table = arrow.concat_tables([self._load(part), table]).combine_chunks()
        if not self._in_place(part, table):
            raise ArgumentError(
                f"columns['{INDEX}']: expected {first}, {first + 1}, ... in part {part} of at most "
                f"{self.manifest.chunk} samples, got {table.column(INDEX).to_pylist()}"
            )
        sink = arrow.BufferOutputStream()
        parquet.write_table(table, sink, write_page_checksum=True)
        try:
            _write_whole(path, sink.getvalue().to_pybytes())
        except OSError as error:
            kept = f"; the {len(self._parts())} finished parts are kept"
            raise _cannot_write(self.folder, error, kept) from None

    def query(self, sql: str) -> Columns:
        """The result of an SQL query of the table ``samples``, as columns; missing numbers come as NaN.

        Raises:
            ArgumentError: DuckDB does not understand the query.
            StateError: there are no samples yet, or a part is damaged.
        """
        duckdb = _duckdb()
        parts = [self._load(part) for part, _ in self._parts()]  # DuckDB's own reader checks no checksums
        if not parts:
            raise StateError(f"store: there are no samples in {self.folder} yet")
        with contextlib.closing(duckdb.connect()) as connection:
            connection.register("samples", _arrow().concat_tables(parts))
            try:
                found = connection.execute(sql).fetchnumpy()
            except duckdb.Error as error:
                raise ArgumentError(f"sql: {error}") from None
        return {name: _plain(values) for name, values in found.items()}

    def read(self, where: str | None = None, columns: Sequence[str] | None = None) -> Columns:
        """Columns of the samples, in the order of their index.

        Args:
            where: an SQL condition on the columns, e.g. "left_u IS NOT NULL AND i < 4000"; None for all.
            columns: their names; None for all.
        """
        known = (INDEX, *self.manifest.columns)
        names = known if columns is None else tuple(columns)
        unknown = [name for name in names if name not in known]
        if unknown:
            raise ArgumentError(f"columns: no column '{unknown[0]}'; there are {', '.join(known)}")
        chosen = ", ".join(f'"{name}"' for name in names)
        condition = "" if where is None else f" WHERE ({where})"
        return self.query(f"SELECT {chosen} FROM samples{condition} ORDER BY {INDEX}")

    def samples(self, seen_by: str | None = "any", where: str | None = None) -> Samples:
        """The samples to learn from.

        Args:
            seen_by: 'any' camera, 'all' cameras, the name of one, or None for all samples, seen or not.
            where: an SQL condition besides, as in :meth:`read`.

        Raises:
            ArgumentError: no such camera, or samples without cameras, as of the arm.
            NotInViewError: no sample is left.
        """
        cameras = self.manifest.cameras
        if not cameras:
            raise ArgumentError(f"store: samples of kind '{self.manifest.kind}' have no cameras; use read()")
        tests = {camera: f'"{camera}_u" IS NOT NULL' for camera in cameras}
        tests |= {"any": " OR ".join(tests.values()), "all": " AND ".join(tests.values())}
        if seen_by is not None and seen_by not in tests:
            raise ArgumentError(f"seen_by: one of {', '.join(tests)} or None expected, got {seen_by!r}")
        conditions = [f"({test})" for test in (where, None if seen_by is None else tests[seen_by]) if test]
        found = self.read(" AND ".join(conditions) or None)
        if not len(found[INDEX]):
            by = "any camera" if seen_by == "any" else "all cameras" if seen_by == "all" else f"'{seen_by}'"
            which = "" if where is None else f" where {where}"
            seen = "" if seen_by is None else f" was seen by {by}"
            raise NotInViewError(f"store: none of the {len(self)} samples in {self.folder}{which}{seen}")
        with_point = all(name in found for name in POINT)
        return Samples(
            self.manifest.joints,
            np.column_stack([found[name] for name in self.manifest.joints]),
            {c: np.column_stack([found[f"{c}_u"], found[f"{c}_v"]]) for c in cameras},
            np.column_stack([found[name] for name in POINT]) if with_point else None,
        )

    def _path(self, part: int) -> Path:
        return self.folder / f"part-{part:05d}.parquet"

    def _parts(self) -> list[tuple[int, Path]]:
        numbered = ((path.stem.removeprefix("part-"), path) for path in self.folder.glob("part-*.parquet"))
        return sorted((int(number), path) for number, path in numbered if number.isdecimal())

    def _schema(self) -> Any:
        arrow = _arrow()
        types = {NUMBER: arrow.float64(), GAP: arrow.float64(), COUNT: arrow.int64(), WORD: arrow.string()}
        columns = {name: types[kind] for name, kind in self.manifest.columns.items()}
        return arrow.schema([(INDEX, arrow.int64()), *columns.items()])

    def _load(self, part: int) -> Any:
        """A part's table, its checksums, columns and indices verified."""
        path = self._path(part)
        try:
            table = _parquet().read_table(path, page_checksum_verification=True, partitioning=None)
        except (OSError, ValueError) as error:
            raise _damaged(path, str(error).splitlines()[0]) from None
        if not table.schema.equals(self._schema()):
            raise _damaged(path, "its columns are not those of the manifest")
        if not self._in_place(part, table):
            raise _damaged(path, "it holds other samples than its name says")
        return table

    def _in_place(self, part: int, table: Any) -> bool:
        """Whether a table holds the first samples of a part, or all."""
        chunk, index = self.manifest.chunk, table.column(INDEX).to_numpy()
        first = part * chunk
        return len(index) <= chunk and np.array_equal(index, np.arange(first, first + len(index)))

    def _checked(self, columns: Mapping[str, npt.ArrayLike]) -> Any:
        arrow = _arrow()
        expected = [INDEX, *self.manifest.columns]
        if set(columns) != set(expected):
            odd = sorted(set(columns) ^ set(expected))
            raise ArgumentError(
                f"columns: {', '.join(expected)} expected; missing or strange: {', '.join(odd)}"
            )
        arrays = []
        for name in expected:
            values = np.asarray(columns[name])
            kind = self.manifest.columns.get(name, COUNT)
            if values.ndim != 1 or values.dtype.kind not in {COUNT: "iu", WORD: "UO"}.get(kind, "fiu"):
                raise ArgumentError(
                    f"columns['{name}']: a {kind} (n,) expected, got {values.dtype} {values.shape}"
                )
            allowed = np.isnan(values.astype(np.float64)) if kind == GAP else False
            if kind in (NUMBER, GAP) and not (np.isfinite(values) | allowed).all():
                bad = int(np.argmin(np.isfinite(values) | allowed))
                which = int(np.asarray(columns[INDEX])[bad])
                raise ArgumentError(
                    f"columns['{name}']: finite numbers expected, got {values[bad]} in sample {which}"
                )
            arrays.append(arrow.array(values, from_pandas=kind == GAP))  # a NaN becomes a null
        lengths = {len(array) for array in arrays}
        if len(lengths) > 1:
            raise ArgumentError(f"columns: the same length everywhere expected, got {sorted(lengths)}")
        return arrow.table(arrays, names=expected).cast(self._schema())


def _write_whole(path: Path, data: bytes) -> None:
    """Write a file so that it is there whole or not at all, also after a power cut."""
    descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}-", suffix=".tmp")
    aside = Path(name)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        aside.chmod(0o644)
        aside.replace(path)
    except BaseException:
        aside.unlink(missing_ok=True)
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def _rows(path: Path) -> int:
    """Rows of a part by its footer, which a file that was cut off does not have."""
    try:
        return int(_parquet().read_metadata(path).num_rows)
    except (OSError, ValueError) as error:
        raise _damaged(path, str(error).splitlines()[0]) from None


def _plain(values: Any) -> npt.NDArray[Any]:
    """A plain array of DuckDB's masked one: missing numbers are NaN, missing words None."""
    gaps = np.ma.getmaskarray(values)
    plain = np.array(np.ma.getdata(values))
    if gaps.any():
        plain = plain.astype(np.float64 if plain.dtype.kind in "iufb" else object)
        plain[gaps] = np.nan if plain.dtype.kind == "f" else None
    return plain


def _damaged(path: Path, reason: str) -> StateError:
    return StateError(f"store: {path} is damaged ({reason}); delete it, and the next run computes it again")


def _cannot_write(folder: Path, error: OSError, more: str = "") -> Exception:
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return StateError(
            f"folder: no space left in {folder}{more}; make room, and the same call goes on from there"
        )
    return ArgumentError(f"folder: cannot write into {folder}: {error.strerror}{more}")


def _arrow() -> Any:
    try:
        import pyarrow
    except ImportError:
        raise MissingExtraError("the store of samples", "learn") from None
    return pyarrow


def _parquet() -> Any:
    _arrow()
    import pyarrow.parquet

    return pyarrow.parquet


def _duckdb() -> Any:
    try:
        import duckdb
    except ImportError:
        raise MissingExtraError("the store of samples", "learn") from None
    return duckdb
