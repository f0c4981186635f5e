"""Rows in files: the journal of a study under way, and the table of one that is done."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from io import TextIOWrapper
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from benchmarks.synthetic.studies.conditions import Value
from benchmarks.synthetic.studies.rows import COLUMN_TYPES, Results, Row

PARQUET = ".parquet"
"""Ending of a file of rows that is written as Parquet; any other is CSV."""


class OtherSettingsError(ValueError):
    """A journal holds the rows of other settings."""


Key = tuple[int, int]
"""Index of the condition and seed of a problem."""


class Journal:
    """The outcomes of a study under way, a line of JSON each, so that what is done outlives an end at any moment.

    The first line holds the settings. A last line that was cut off counts as not written.
    """

    def __init__(self, path: Path, settings: Mapping[str, Any]) -> None:
        """Read what an earlier run left at `path`; OtherSettingsError when other settings made it."""
        self._path = path
        self._file: TextIOWrapper | None = None
        self.done: dict[Key, Row] = {}
        lines = list(_whole_lines(path)) if path.exists() else []
        self._header = "" if lines else _json({"settings": settings})
        self._kept_bytes = sum(len(line) for line in lines)
        if lines:
            _refuse_other_settings(path, _record(path, lines[0], 1)["settings"], settings)
        for number, line in enumerate(lines[1:], 2):
            record = _record(path, line, number)
            self.done[record["condition"], record["seed"]] = record["row"]

    def __enter__(self) -> Self:
        """Open the file to append to what is whole in it."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._path.touch()
        self._file = self._path.open("r+", encoding="utf-8", newline="\n")
        self._file.truncate(self._kept_bytes)
        self._file.seek(self._kept_bytes)
        if self._header:
            self._write([self._header])
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()

    def add(self, outcomes: Mapping[Key, Row]) -> None:
        """Write outcomes and hand them to the operating system."""
        self.done.update(outcomes)
        lines = [{"condition": key[0], "seed": key[1], "row": row} for key, row in outcomes.items()]
        self._write([_json(line) for line in lines])

    def _write(self, lines: Sequence[str]) -> None:
        if self._file is None:
            raise ValueError(f"{self._path}: the journal is closed; needed an open one, `with Journal(...)`")
        self._file.write("".join(f"{line}\n" for line in lines))
        self._file.flush()


def _json(values: Mapping[str, Any]) -> str:
    return json.dumps(values, separators=(",", ":"))


def _whole_lines(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        for line in file:
            if line.endswith(b"\n"):
                yield line


def _record(path: Path, line: bytes, number: int) -> dict[str, Any]:
    try:
        record = json.loads(line)
    except ValueError as error:
        raise ValueError(f"{path}: line {number} is not JSON ({error}); needed the journal of a study") from error
    needed = {"settings"} if number == 1 else {"condition", "seed", "row"}
    if not (isinstance(record, dict) and needed <= record.keys()):
        raise ValueError(f"{path}: line {number} lacks {', '.join(sorted(needed))}; needed the journal of a study")
    return record


def _refuse_other_settings(path: Path, found: Mapping[str, Any], needed: Mapping[str, Any]) -> None:
    needed = json.loads(_json(needed))
    for name in {**needed, **found}:
        if found.get(name) != needed.get(name):
            raise OtherSettingsError(
                f"{path}: holds rows of other settings, {name} {_brief(found.get(name))}; needed"
                f" {_brief(needed.get(name))}: take the same settings up again, choose another file or start anew"
            )


LONGEST_SETTING = 300
"""Characters of a setting in a message, at the most."""


def _brief(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= LONGEST_SETTING else f"{text[: LONGEST_SETTING - 3]}..."


def write_rows(path: Path, results: Results) -> None:
    """Write the rows: Parquet for a name that ends in .parquet, else CSV with nothing between commas for None."""
    if path.suffix == PARQUET:
        _parquet().write_table(_arrow_table(results), path)
        return
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(COLUMN_TYPES), lineterminator="\n")
        writer.writeheader()
        writer.writerows(results.rows)


def read_rows(path: Path, settings: Mapping[str, Any] | None = None) -> Results:
    """The rows of a file that `write_rows` wrote; ValueError for another one."""
    if path.suffix == PARQUET:
        records: list[dict[str, Any]] = _parquet().read_table(path).to_pylist()
    else:
        with path.open(encoding="utf-8", newline="") as file:
            records = [{k: _value(k, v) for k, v in record.items()} for record in csv.DictReader(file)]
    for number, record in enumerate(records, 1):
        missing = [name for name in COLUMN_TYPES if name not in record]
        if missing:
            raise ValueError(f"{path}: row {number} has no column {missing[0]}; needed rows of a study")
    return Results(settings or {}, records)


def _value(name: str, text: str) -> Value:
    kind = COLUMN_TYPES.get(name, str)
    if kind is str:
        return text
    if text == "":
        return None
    if kind is bool:
        return text == "True"
    number: int | float = kind(text)
    return number


def check_rows_path(path: Path) -> None:
    """ImportError when the file's kind needs an extra that is not there: better known before hours of work."""
    if path.suffix == PARQUET:
        _parquet()


def _parquet() -> Any:
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise ImportError(
            "pyarrow is not installed; needed: pip install 'regionpose[studies]', or a name in .csv"
        ) from error
    return pyarrow.parquet


def _arrow_table(results: Results) -> Any:
    import pyarrow

    kinds = {str: pyarrow.string(), int: pyarrow.int64(), float: pyarrow.float64(), bool: pyarrow.bool_()}
    schema = pyarrow.schema([(name, kinds[kind]) for name, kind in COLUMN_TYPES.items()])
    return pyarrow.Table.from_pylist(list(results.rows), schema=schema)
