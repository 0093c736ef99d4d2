"""Ten thousand files and texts that nobody has thought of: each is read, or refused by a named error in a sentence."""

import copy
import re
import tomllib
import warnings

import numpy as np
import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from nav.app.test_analysis_cli import RECORD, TEXT
from nav.app.test_bad_inputs import places, put

import gmwm_jax as gj
from gmwm_jax._internal.entry import OF_INPUT
from nav_jax.app.comparison_file import read_config
from nav_jax.app.record_file import read_record

CASES = 10_000
FEW = {"deadline": None, "derandomize": True, "database": None, "suppress_health_check": list(HealthCheck)}


def cases(share):
    """So many of all cases, the same in each run."""
    return settings(max_examples=int(share * CASES), **FEW)


RAW = re.compile(r"codec can't|could not convert|invalid literal|to unpack|out of (range|bounds)|object is not|unhash")
"""What Python and NumPy say of themselves, and not of the file."""


def refusal(call):
    """The error, if there is one of an input, or None."""
    try:
        with warnings.catch_warnings(action="ignore"):
            call()
    except OF_INPUT as error:
        return error
    return None


class Seen:
    """How many were read and how many refused, each in a sentence."""

    read = refused = 0

    def look(self, call):
        """Whether it was read."""
        error = refusal(call)
        if error is None:
            self.read += 1
            return True
        self.refused += 1
        assert len(str(error)) > 20, repr(error)
        assert not RAW.search(re.sub(r"\(.*\)$", "", str(error), flags=re.S)), repr(error)  # what a library says of it
        return False

    def assert_both(self):
        """Cases that are all good, or all bad from the first byte on, would test little."""
        assert min(self.read, self.refused) > 0.01 * (self.read + self.refused), (self.read, self.refused)


ROWS = [f"{i / 100:.2f},{np.sin(i * i):.6f},{np.cos(i * i):.6f}" for i in range(40)]
GOOD = "\n".join(["time [s],gyro_x [rad/s],accel_x [m/s^2]", *ROWS]) + "\n"
ODD = st.sampled_from([
    "nan", "inf", "-", "", "1e999", "0x10", "1_000", "1,5", "1;5", '"', "'", "#", "%", "//", "\t", "\0", "\r", "\ufeff",
    "é", "☃",
    "time", "gyro", "[rad/s]", "12:00:00", "2026-11-22T12:00:00Z", "9" * 400, "," * 30, " " * 30,
])  # fmt: skip


@st.composite
def tables(draw):
    """A good table in which some places are something else."""
    text = GOOD
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(text)))
        length = draw(st.sampled_from([0, 1, 5, 200]))
        text = text[:at] + draw(st.one_of(ODD, st.text(max_size=8))) + text[at + length :]
    return text


CONTENTS = st.one_of(
    tables().map(lambda text: text.encode("utf-8", "surrogatepass")),
    tables().map(lambda text: text.encode("utf-16", "surrogatepass")),
    st.binary(max_size=400),
    st.text(alphabet="0123456789.,;-+eE \n\t#nax", max_size=300).map(str.encode),
)


@pytest.mark.parametrize("suffix", [".csv", ".txt", ".imu"])
def test_text_files(tmp_path, suffix):
    file, seen = tmp_path / f"x{suffix}", Seen()

    @given(CONTENTS, st.sampled_from([{}, {"time": 0}, {"rate": 100.0, "units": "rad/s"}, {"gaps": "nan", "time": 0}]))
    @cases(0.15)
    def read(content, options):
        file.write_bytes(content)
        recordings = []
        if seen.look(lambda: recordings.append(gj.read_recording(file, **options))):
            (rec,) = recordings
            assert rec.rate > 0
            assert rec.gaps or np.isfinite(rec.data).all()

    read()
    seen.assert_both()


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".csv.gz", ".zip", ".rda", ".parquet", ".nc", ".bag", ".mcap"])
def test_binary_files(tmp_path, suffix):
    """Good files in which some bytes are others, which decompressors and parsers of others meet first."""
    good = tmp_path / "good.npz"
    np.savez(good, data=np.ones((30, 2)))
    np.save(tmp_path / "good.npy", np.ones((30, 2)))
    seeds = [
        good.read_bytes(),
        (tmp_path / "good.npy").read_bytes(),
        b"RDX3\nX\n",
        b"PAR1",
        b"\x89HDF\r\n\x1a\n",
        b"#ROSBAG V2.0\n",
    ]
    file = tmp_path / f"x{suffix}"

    @given(st.sampled_from(seeds), st.integers(0, 700), st.binary(max_size=40))
    @cases(0.01)
    def read(seed, at, noise):
        file.write_bytes(seed[:at] + noise + seed[at + len(noise) :])
        Seen().look(lambda: gj.read_recording(file, rate=100.0, units="rad/s"))

    read()


VALUES = st.recursive(
    st.one_of(
        st.booleans(), st.integers(-(10**19), 10**19).filter(lambda i: -(2**63) <= i < 2**63), st.floats(),
        st.text(alphabet="abcdeg/^*+-.()0123456789 WNGMRhzmsd", max_size=12),
        st.sampled_from(["1 m", "-1 m", "1e99 s", "truth", "circle", "gnss_position", "WN(sigma2=1e-4)", "none.csv"]),
    ),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(alphabet="abc", max_size=3), inner, max_size=3),
    max_leaves=4,
)  # fmt: skip


def changed(text):
    """The tables of a configuration with one to three values that are others, or gone."""
    tables_ = tomllib.loads(text)

    @st.composite
    def change(draw):
        tables = copy.deepcopy(tables_)
        for _ in range(draw(st.integers(1, 3))):
            place = draw(st.sampled_from(list(places(tables)) or [("x",)]))
            tables = put(tables, place, draw(st.none() | VALUES) if len(place) > 1 else draw(VALUES))
        return tables

    return change()


@pytest.mark.parametrize(("text", "read"), [(TEXT, read_config), (RECORD, read_record)], ids=["compare", "navigate"])
def test_configurations(tmp_path, text, read):
    time, still = np.arange(200) / 20, np.zeros(200)
    imu = np.stack([time, still, still, still, still, still, still - 1.0], axis=1)
    np.savetxt(
        tmp_path / "imu.csv",
        imu,
        delimiter=",",
        header="time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z",
        comments="",
    )
    np.savez(tmp_path / "gnss.npz", time_s=time[20:180:20], east_m=still[:8], north_m=still[:8], down_m=still[:8])
    (tmp_path / "baro.csv").write_text("time_ms,height_m\n1000,5\n2500,6\n")
    path, seen = tmp_path / "a.toml", Seen()

    @given(changed(text))
    @cases(0.1)
    def check(tables):
        path.write_text(tomli_w.dumps(tables), encoding="utf-8", errors="replace")
        seen.look(lambda: read(path))

    check()
    seen.assert_both()


@given(st.text(alphabet="[]=.\"'{}\n#, abc019-", max_size=200))
@cases(0.1)
def test_text_that_may_be_toml(tmp_path_factory, text):
    path = tmp_path_factory.getbasetemp() / "fuzz.toml"
    path.write_text(text)
    for read in (read_config, read_record):
        Seen().look(lambda read=read: read(path))


MODELS = st.text(alphabet="WNGMRAQDRLSI(),=+*0123456789.e- sigma2betvrncphixd", max_size=40)


@given(st.one_of(MODELS, st.text(max_size=20)))
@cases(0.15)
def test_models_and_units(text):
    Seen().look(lambda: gj.parse_model(text))
    Seen().look(lambda: gj.units.convert(1.0, text, "rad/s"))
    Seen().look(lambda: gj.from_datasheet({"N": text}, 100.0))
