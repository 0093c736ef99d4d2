"""Files that ask for more than they are: each is refused before it is unfolded, and what is honest is read."""

import bz2
import gzip
import json
import lzma
import resource
import struct
import zipfile

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from gmwm_jax._internal import limits, r_files, text_files
from gmwm_jax._internal.limits import TooLargeError, allowed, as_bytes, size_in_bytes
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.saved import load
from gmwm_jax._internal.tabular import open_file
from gmwm_jax.recordings.files import read_recording

MB = 1_000_000
PEAK = 300 * MB
"""Bytes by which the process may grow while a file is refused."""

COMPRESS = {".gz": gzip.compress, ".bz2": bz2.compress, ".xz": lzma.compress}


def refused(read, message, error=ValueError):
    """Refuse with these words, and in little memory."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(error, match=message) as caught:
        read()
    assert 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) < PEAK
    assert len(str(caught.value)) < 2000
    return str(caught.value)


def opened(path, **how):
    """All columns of a file."""
    table = open_file(path, Reading(**how))
    return table.load(list(range(table.count)))


def packed(path, content):
    """Write what is told by the suffix."""
    if path.suffix == ".zip":
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(path.stem, content)
    else:
        part = COMPRESS[path.suffix](content[:MB])  # parts behind each other are one file
        path.write_bytes(part * (len(content) // MB) if len(content) > MB else part)
    return path


# -- sizes and options ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "size"),
    [("8GB", 8 * 10**9), ("1.5 g", 15 * 10**8), ("64MiB", 1 << 26), (4096, 4096), ("2e9", 2 * 10**9), (None, None),
     ("1kB", 1000), ("2TiB", 2 << 40)],
)  # fmt: skip
def test_sizes_as_people_write_them(value, size):
    assert size_in_bytes(value) == size


@pytest.mark.parametrize("value", ["lots", -1, 0, True, "8 XB", "", 1.5j])
def test_what_is_no_size(value):
    with pytest.raises(ValueError, match=r'number of bytes, or a text such as "8GB"'):
        size_in_bytes(value)


def test_a_file_may_be_as_large_as_it_is():
    assert allowed(10 * MB, None) == 200 * 10 * MB
    assert allowed(1000, None) == limits.FREE
    assert allowed(100_000 * MB, None) == 100_000 * MB
    assert allowed(100 * MB, None) == limits.MAX_BYTES
    assert (allowed(1000, 5000), allowed(9000, 5000)) == (5000, 9000)


def test_sizes_in_sentences():
    assert [as_bytes(n) for n in (12, 4_300, 4_300_000, 4_300_000_000, 8 * 10**12)] == [
        "12 bytes", "4.3 kB", "4.3 MB", "4.3 GB", "8 TB"
    ]  # fmt: skip
    assert len(as_bytes(10**40)) < 20


# -- NumPy ------------------------------------------------------------------------------------------------------------


def npy(shape, kind="<f8", version=1):
    header = repr({"descr": kind, "fortran_order": False, "shape": shape}).encode().ljust(117) + b"\n"
    return b"\x93NUMPY" + bytes([version, 0]) + struct.pack("<H" if version == 1 else "<I", len(header)) + header


@pytest.mark.parametrize("version", [1, 2, 3])
@pytest.mark.parametrize("shape", [(10**12,), (10**12, 6), (2,)])
def test_an_array_that_promises_what_is_not_there(tmp_path, shape, version):
    path = tmp_path / "lies.npy"
    path.write_bytes(npy(shape, version=version) + bytes(8))
    refused(lambda: opened(path), "promises float64 of shape" if version < 3 else "version")
    with zipfile.ZipFile(tmp_path / "lies.npz", "w") as archive:
        archive.write(path, "x.npy")
    refused(lambda: opened(tmp_path / "lies.npz"), "promises float64 of shape" if version < 3 else "version")


def test_an_archive_of_zeros(tmp_path):
    path = tmp_path / "zeros.npz"
    np.savez_compressed(path, x=np.append(np.zeros(40 * MB // 8 - 1), 1.0))
    said = refused(lambda: read_recording(path, rate=1.0, units="rad/s"), "zeros.npz: .* would take 40 MB of memory")
    assert 'max_bytes="41MB"' in said
    assert len(read_recording(path, rate=1.0, units="rad/s", max_bytes="41MB").data) == 40 * MB // 8


def test_an_archive_with_other_things(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("note.txt", "hello")
    refused(lambda: opened(tmp_path / "a.npz"), "no NumPy file")


# -- text -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".gz", ".bz2", ".xz", ".zip"])
def test_packed_text_without_end(tmp_path, suffix, monkeypatch):
    monkeypatch.setattr(limits, "FREE", 4 * MB)
    path = packed(tmp_path / f"a.csv{suffix}", b"1,2\n" * (2 * MB))
    refused(lambda: opened(path), "unpacks to more than .* MB", TooLargeError)
    np.testing.assert_array_equal(opened(packed(tmp_path / f"b.csv{suffix}", b"1,2\n" * 1000))[1], np.full(1000, 2.0))


def test_a_packed_binary_file(tmp_path):
    path = tmp_path / "a.npy.gz"
    path.write_bytes(gzip.compress(npy((5 * MB,)) + bytes(40 * MB)))
    refused(lambda: opened(path), "unpacks to more than", TooLargeError)
    assert len(opened(path, max_bytes=50 * MB)[0]) == 5 * MB


def test_a_packed_file_may_be_as_large_as_is_said(tmp_path):
    path = packed(tmp_path / "a.csv.gz", b"1,2\n" * 1000)
    refused(lambda: opened(path, max_bytes=2000), "unpacks to more than 2 kB", TooLargeError)
    assert len(opened(path, max_bytes=4000)[0]) == 1000


def test_an_archive_with_a_password(tmp_path):
    path = packed(tmp_path / "a.csv.zip", b"1,2\n3,4\n")
    content = bytearray(path.read_bytes())
    for magic, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.index(magic) + flags] |= 1
    path.write_bytes(content)
    refused(lambda: opened(path), "password required")


@pytest.fixture(params=["pandas", "numpy"])
def tokenizer(request, monkeypatch):
    monkeypatch.setattr(text_files, "_pandas_pays", lambda file: request.param == "pandas")


LONG = b"1," * (25 * MB)


@pytest.mark.parametrize(("before", "line"), [(0, 1), (1, 2), (1000, 1001), (300_000, 300_001)])
@pytest.mark.parametrize("end", [b"\n", b"\r"])
def test_a_line_of_50_mb(tmp_path, tokenizer, before, line, end):
    path = tmp_path / "a.csv"
    path.write_bytes((b"1,2" + end) * before + LONG + end + (b"3,4" + end) * 10)
    refused(lambda: opened(path), f"Line {line} is longer than 65536 characters", TooLargeError)


def test_the_longest_line_is_read(tmp_path, tokenizer):
    """Where parts of the file meet, too."""
    path = tmp_path / "a.csv"
    wide = b"1," + b"0" * (limits.LONGEST_LINE - 5) + b"1\n"
    path.write_bytes((wide + b"1,2\n") * 40)
    np.testing.assert_array_equal(opened(path)[1], [1.0, 2.0] * 40)
    path.write_bytes((wide + b"1,2\n") * 40 + b"1,00" + wide[2:])
    refused(lambda: opened(path), "Line 81 is longer", TooLargeError)


@pytest.mark.parametrize("columns", [1001, 20_000])
def test_columns(tmp_path, columns):
    path = tmp_path / "a.csv"
    path.write_text((",".join(["1"] * columns) + "\n") * 2)
    refused(lambda: opened(path), f"has {columns} columns, and at most 1000", TooLargeError)
    path.write_text((",".join(["1"] * 1000) + "\n") * 2)
    assert len(opened(path)) == 1000


def test_two_million_columns(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b"1," * (2 * MB) + b"1\n" + b"1," * (2 * MB) + b"1\n")
    refused(lambda: opened(path), "Line 1 is longer", TooLargeError)


def test_a_message_repeats_no_more_than_some_fields(tmp_path, tokenizer):
    path = tmp_path / "a.csv"
    path.write_bytes(b"1,2\n" * 100 + b"1," * 10_000 + b"1\n")
    refused(lambda: opened(path), r"Line 101 has 10001 fields, and the first line of data 2: .* \.\.\.$")


def test_integers_of_many_digits(tmp_path, tokenizer):
    path = tmp_path / "a.csv"
    for field, value in (("1" * 5000, np.inf), ("12345678901234567890", 12345678901234567890.0)):
        path.write_text(f"{field},2\n" * 3)
        np.testing.assert_array_equal(opened(path), [[value] * 3, [2.0] * 3])
    path.write_text("1234567890123456789,2\n98765432109876543210,2\n")
    np.testing.assert_array_equal(opened(path)[0], [1234567890123456789.0, 98765432109876543210.0])


# -- R ----------------------------------------------------------------------------------------------------------------


def rda(path, content, pack=gzip.compress):
    """Write an R object as the only variable, x."""
    name = struct.pack(">iiii", 1026, 1, 9 | 64 << 12, 1) + b"x"  # a pair with a tag: a symbol of one character
    whole = b"RDX2\nX\n" + struct.pack(">iii", 2, 3 << 16, 2 << 16) + name + content + struct.pack(">i", 254)
    path.write_bytes(pack(whole))
    return path


def symbol(name):
    return struct.pack(">iii", 1, 9 | 64 << 12, len(name)) + name


def pair(first, rest):
    return struct.pack(">i", 2) + first + rest


NIL = struct.pack(">i", 254)


def sequence(count, name=b"compact_realseq"):
    state = struct.pack(">iiddd", 14, 3, count, 1.0, 1.0)
    info = pair(symbol(name), pair(symbol(b"base"), pair(struct.pack(">iii", 13, 1, 14), NIL)))
    return struct.pack(">i", 238) + info + state + NIL


def test_honest_r_data(tmp_path):
    values = opened(rda(tmp_path / "a.rda", struct.pack(">iiddd", 14, 3, 1.0, 2.0, 4.0)))
    np.testing.assert_array_equal(values[0], [1.0, 2.0, 4.0])
    np.testing.assert_array_equal(opened(rda(tmp_path / "b.rda", sequence(5)))[0], np.arange(1.0, 6.0))


@pytest.mark.parametrize("pack", COMPRESS.values())
def test_r_data_of_zeros(tmp_path, pack):
    path = rda(tmp_path / "a.rda", struct.pack(">ii", 14, 5 * MB) + bytes(40 * MB), pack)
    refused(lambda: opened(path), "unpacks to more than", TooLargeError)


@pytest.mark.parametrize("name", [b"compact_intseq", b"compact_realseq"])
def test_a_sequence_of_r(tmp_path, name):
    path = rda(tmp_path / "a.rda", sequence(1e10, name))
    said = refused(lambda: opened(path), "sequences of the R data would take 80 GB", TooLargeError)
    assert 'max_bytes="80GB"' in said


def test_r_data_of_many_objects(tmp_path, monkeypatch):
    monkeypatch.setattr(r_files, "MAX_R_NUMBERS", 10_000)
    path = rda(tmp_path / "a.rda", struct.pack(">ii", 19, 5 * MB) + NIL * (5 * MB))
    refused(lambda: opened(path), "more than .* objects or texts", TooLargeError)


def test_a_vector_of_r_that_promises_what_is_not_there(tmp_path):
    refused(lambda: opened(rda(tmp_path / "a.rda", struct.pack(">ii", 14, 2**31 - 1))), "a vector of 2147483647 values")
    text = b"RDA2\nA\n2\n196608\n131072\n14\n2147483647\n1\n"
    (tmp_path / "b.rda").write_bytes(text)
    refused(lambda: opened(tmp_path / "b.rda"), "a vector of 2147483647 values")


def test_deep_r_data(tmp_path):
    path = rda(tmp_path / "a.rda", struct.pack(">ii", 19, 1) * 100_000 + NIL)
    refused(lambda: opened(path), "no R data file")


# -- Parquet, HDF5, Zarr ----------------------------------------------------------------------------------------------


def test_a_parquet_file_of_zeros(tmp_path):
    path = tmp_path / "a.parquet"
    column = pa.array(np.zeros(3 * MB))
    pq.write_table(pa.table({"a": column, "b": column}), path)
    refused(lambda: opened(path), "columns would take 48 MB of memory", TooLargeError)
    assert len(open_file(path).load([1])[0]) == 3 * MB
    assert len(opened(path, max_bytes=48 * MB)[0]) == 3 * MB


@pytest.mark.parametrize("name", ["time", "x"])
def test_a_netcdf_file_that_nobody_filled(tmp_path, name):
    """Nor is its coordinate, which xarray loads when it opens a file."""
    path = tmp_path / "a.nc"
    with h5py.File(path, "w") as file:
        time = file.create_dataset("time", (10**12,), "f8", chunks=(1000,))
        time.make_scale("time")
        if name == "x":
            file.create_dataset("x", (10**12,), "i1", chunks=(1000,)).dims[0].attach_scale(time)
    refused(lambda: opened(path), "variables would take (8|16) TB of memory", TooLargeError)
    refused(lambda: load(path), "result would take (8|16) TB of memory", TooLargeError)


def test_a_zarr_folder_that_nobody_filled(tmp_path):
    folder = tmp_path / "a.zarr"
    (folder / "x").mkdir(parents=True)
    (folder / ".zgroup").write_text('{"zarr_format": 2}')
    array = {"shape": [10**12], "chunks": [1000], "dtype": "<f8", "fill_value": 0.0, "order": "C", "filters": None}
    (folder / "x" / ".zarray").write_text(json.dumps({**array, "compressor": None, "zarr_format": 2}))
    refused(lambda: load(folder), "result would take 8 TB of memory", TooLargeError)


def test_deep_json(tmp_path):
    (tmp_path / "a.json").write_text("[" * MB)
    refused(lambda: load(tmp_path / "a.json"), "corrupt, cut off or something else")


# -- bags -------------------------------------------------------------------------------------------------------------


def bag(path, content, size):
    def field(name, value):
        return struct.pack("<I", len(name) + 1 + len(value)) + name + b"=" + value

    header = field(b"op", b"\x05") + field(b"compression", b"bz2") + field(b"size", struct.pack("<I", size))
    path.write_bytes(b"#ROSBAG V2.0\n" + struct.pack("<I", len(header)) + header + struct.pack("<I", len(content)))
    with path.open("ab") as file:
        file.write(content)
    return path


def mcap(path, content, size, compression=b"zstd"):
    body = struct.pack("<QQQII", 0, 0, size, 0, len(compression)) + compression + struct.pack("<Q", len(content))
    path.write_bytes(b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, len(body) + len(content)) + body + content)
    return path


def zstd(content):
    module = pytest.importorskip("backports.zstd")
    return module.compress(content)


@pytest.mark.parametrize(
    "write",
    [
        lambda folder: bag(folder / "a.bag", bz2.compress(bytes(40 * MB)), 100),
        lambda folder: bag(folder / "a.bag", b"", 2**32 - 1),
        lambda folder: mcap(folder / "a.mcap", zstd(bytes(40 * MB)), 100),
        lambda folder: mcap(folder / "a.mcap", b"", 10**15),
    ],
)
def test_chunks_of_bags(tmp_path, write):
    path = write(tmp_path)
    refused(lambda: opened(path), "unpacks to more than|chunk of the bag would take", TooLargeError)


# -- other threads ----------------------------------------------------------------------------------------------------


def test_reading_r_data_leaves_the_filters_of_warnings_alone(tmp_path, monkeypatch):
    import warnings

    def touched(*arguments, **options):
        raise AssertionError("Filters of warnings are those of all threads.")

    path = rda(tmp_path / "a.rda", struct.pack(">iid", 14, 1, 1.0))
    opened(path)  # what is imported by now may have its own ways
    for name in ("catch_warnings", "simplefilter", "filterwarnings"):
        monkeypatch.setattr(warnings, name, touched)
    opened(path)
