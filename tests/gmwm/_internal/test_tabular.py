"""The reader of tables: pandas' tokenizer and NumPy's give the same numbers and refuse the same lines."""

import sys

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from gmwm_jax._internal import text_files
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.tabular import open_file, open_source

X = np.random.default_rng(3).normal(size=(200, 4)) * 10.0 ** np.arange(-9, 3, 3)


@pytest.fixture(params=["pandas", "numpy"])
def tokenizer(request, monkeypatch):
    """Both tokenizers; the other one is not called."""
    other = {"pandas": (np, "loadtxt"), "numpy": (pd, "read_csv")}[request.param]

    def not_this(*arguments, **options):
        raise AssertionError(f"{other[1]} was called.")

    monkeypatch.setattr(*other, not_this)
    if request.param == "numpy":
        monkeypatch.setattr(text_files, "_pandas_pays", lambda file: False)
    return request.param


def write(path, text, encoding="utf-8"):
    path.write_bytes(text.encode(encoding))
    return path


def read(path, picked=None, **how):
    table = open_file(path, Reading(**how))
    return np.stack(table.load(list(range(table.count)) if picked is None else picked), axis=1)


def rows(separator=",", end="\n"):
    return "".join(separator.join(f"{v:.17g}" for v in row) + end for row in X)


@pytest.mark.parametrize("head", ["", "a,b,c,d\n", "# one\n\n# a,b,c,d\n", '"odd "" quote",b,c,d\n', "°,b,c,d\n"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\n\n", " \n"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_numbers_come_back_bit_by_bit(tmp_path, tokenizer, head, end, encoding):
    path = write(tmp_path / "a.csv", head + rows(end=end), encoding)
    np.testing.assert_array_equal(read(path), X)
    np.testing.assert_array_equal(read(path, [2, 0]), X[:, [2, 0]])


@pytest.mark.parametrize("separator", [";", "\t", " ", "   ", ", "])
def test_separators(tmp_path, tokenizer, separator):
    np.testing.assert_array_equal(read(write(tmp_path / "a.txt", rows(separator))), X)


def test_what_numbers_are(tmp_path, tokenizer):
    path = write(tmp_path / "a.csv", '1,nan,inf\n"2",NaN,-Infinity\n+.5,1.,2e-3 # last\n#end\n1e400,NAN,1e-400\n')
    expected = [[1, np.nan, np.inf], [2, np.nan, -np.inf], [0.5, 1, 2e-3], [np.inf, np.nan, 0]]
    np.testing.assert_array_equal(read(path), expected)


def test_columns_of_text_are_left_out(tmp_path, tokenizer):
    path = write(tmp_path / "a.csv", "t,state,x,more\n1,ok,2,\n2,NA,3,°\n3,,4,a b\n", "latin-1")
    np.testing.assert_array_equal(read(path, [2, 0]), [[2, 1], [3, 2], [4, 3]])


BAD = [
    ("1,2\n3,x\n", None, "Line 2, column 1 holds the text 'x'"),
    ("1,2\n3,True\n", None, "Line 2, column 1 holds the text 'True'"),
    ("1,True\n3,False\n", None, "Line 1, column 1 holds the text 'True'"),
    ("1,2\n3,1_000\n", None, "Line 2, column 1 holds the text '1_000'"),
    ("1,2\n3,0x10\n", None, "Line 2, column 1 holds the text '0x10'"),
    ("1,2\n3,NA\n", None, "Line 2, column 1 holds the text 'NA'"),
    ("1;2.0\n3;4,5\n", None, "Write decimal commas as points"),
    ("1,2\n3,\n", None, "Line 2, column 1 is empty"),
    ("1,2\n3\n", None, "Line 2 has 1 fields"),
    ("1,2\n3,4,5\n", None, "Line 2 has 3 fields"),
    ("1,2\n3,4,5\n", [0], "Line 2 has 3 fields"),
    ("1,2\n3\n", [0], "Line 2 has 1 fields"),
    ("1,a\n3\n", [0], "Line 2 has 1 fields"),
    ("1,2\n3,4\x00\x00\n", None, "Line 2, column 1 holds the text '4"),
]


@pytest.mark.parametrize(("text", "picked", "message"), BAD)
@pytest.mark.parametrize("with_pandas", [True, False])
def test_both_refuse_the_same_lines(tmp_path, monkeypatch, text, picked, message, with_pandas):
    monkeypatch.setattr(text_files, "_pandas_pays", lambda file: with_pandas)
    with pytest.raises(ValueError, match=message):
        read(write(tmp_path / "a.csv", text), picked)


def test_what_only_a_person_reads_is_read_line_by_line(tmp_path):
    """Comments of another kind, and blanks between lines, which the tokenizers in C refuse."""
    path = write(tmp_path / "a.csv", "1,2\n  \n% comment\n3,4\n")
    np.testing.assert_array_equal(read(path), [[1, 2], [3, 4]])
    np.testing.assert_array_equal(read(path, [1]), [[2], [4]])


def test_pandas_is_imported_where_it_pays(tmp_path, monkeypatch):
    path = write(tmp_path / "a.csv", rows())
    assert text_files._pandas_pays(path)  # it is imported above
    monkeypatch.delitem(sys.modules, "pandas")
    assert not text_files._pandas_pays(path)
    monkeypatch.setattr(text_files, "_PANDAS_PAYS", 1000)
    assert text_files._pandas_pays(path)


def test_one_table_from_every_source(tmp_path):
    """The same names and numbers from each format and each library."""
    columns = {name: X[:, i] for i, name in enumerate("abcd")}
    frame = pd.DataFrame(columns)
    frame.to_parquet(tmp_path / "a.parquet")
    frame.to_csv(tmp_path / "a.csv", index=False)
    dataset = xr.Dataset({name: ("n", x, {"units": "m"}) for name, x in columns.items()})
    dataset.to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    np.savez(tmp_path / "a.npz", **columns, matrix=X)
    np.savez(tmp_path / "b.npz", data=X, columns=list("abcd"))
    files = [tmp_path / name for name in ("a.parquet", "a.csv", "a.nc", "a.npz", "b.npz")]
    for source in (*files, columns, frame, dataset):
        table = open_source(source)
        assert table.names == tuple("abcd")
        np.testing.assert_array_equal(np.stack(table.load([0, 1, 2, 3]), axis=1), X)
    assert open_source(tmp_path / "a.nc").units == dict.fromkeys("abcd", "m")
    assert open_source(tmp_path / "a.npz").skipped == ("matrix",)
    np.testing.assert_array_equal(read(tmp_path / "a.npz", variable="matrix"), X)
