"""Results come back from files as they were, and files that are not what was written are refused in a sentence."""

import copy
import io
import json
import subprocess
import sys
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import numpy as np
import pytest
from helpers import arrays_of, assert_same_result

import gmwm_jax as gj
from gmwm_jax._internal import state_files
from gmwm_jax._internal.saved import load
from gmwm_jax._internal.state_files import Content, read_state, write_state
from gmwm_jax._internal.states import State, registered, to_state
from gmwm_jax.fitting import Fit
from gmwm_jax.fitting.weights import Default, Given
from gmwm_jax.inference import Bootstrap, Selection
from gmwm_jax.multisignal import JointFit
from gmwm_jax.variance import Robust, WaveletVariance
from gmwm_jax.variance.estimator import Modwt

FORMATS = (".npz", ".json", ".nc", ".zarr")
WRITTEN_BY_FORMAT_1 = Path(__file__).parent / "fit_of_format_1.json"


def record(num_samples, seed, channels=("accel_x",)):
    return gj.datasets.simulated("mti-g", num_samples, key=jax.random.key(seed), channels=list(channels))


@pytest.fixture(scope="module")
def fit():
    return gj.fit(gj.wavelet_variance(record(3000, 1)), "WN + RW")


@pytest.fixture(scope="module")
def results(fit):
    """One of each kind, with gaps, robust estimates, weights of a user, held values and components at zero."""
    several = gj.wavelet_variance(record(2000, 2, ("accel_x", "gyro_y")))
    gappy = np.random.default_rng(3).normal(size=2000)
    gappy[300:350] = np.nan
    held = gj.WN() + gj.RW(gamma2=gj.Fixed(1e-9))
    wvs = [gj.wavelet_variance(record(n, n)) for n in (1000, 2000)]
    return {
        "wavelet variance": fit.wv,
        "of several channels": several,
        "with gaps": gj.wavelet_variance(gappy, gaps="pairs", rate=50.0),
        "robust": gj.wavelet_variance(record(2000, 4), efficiency=0.6),
        "from a table": WaveletVariance.from_table(
            [2, 4], [1.0, 0.5], [0.9, 0.4], [1.1, 0.6], unit="rad/s", name="ü/x"
        ),
        "fit": fit,
        "fit with weights given": gj.fit(fit.wv, "WN", weights=np.arange(1.0, fit.wv.num_scales + 1)),
        "fit with a value held": gj.fit(fit.wv, held, weights="covariance"),
        "fit at a boundary": gj.fit(fit.wv, "WN + QN + DR"),
        "fits": gj.fit(several, "WN + RW"),
        "selection": gj.select(fit.wv, "WN + QN + RW"),
        "bootstrap": gj.bootstrap(fit, 20, key=jax.random.key(0)),
        "joint fit": gj.fit_records(wvs, "WN + RW"),
        "joint fits": gj.fit_records([several, several], "WN"),
        "each fit": gj.fit_each(
            {"a": record(2000, 1), "b": record(2000, 2, ("accel_x", "gyro_y")), "c": "c.npz"}, "WN"
        ),
        "Allan deviation": gj.allan_deviation(several),
        "goodness of fit": gj.inference.goodness_of_fit(fit),
        "regression": with_trend(),
        "robust comparison": gj.variance.compare_robust(record(2000, 4)["accel_x"]),
        "records compared": gj.multisignal.compare_records(gj.fit_records(wvs, "WN + RW")),
        "influence": gj.fitting.influence(record(1000, 1000), "WN + RW"),
        "posterior": gj.fitting.posterior(fit.wv, "WN + RW", bounds={"RW gamma2": (1e-14, 1e-12)}),
    }


def with_trend():
    """Of a record with missing samples."""
    y = np.random.default_rng(5).normal(size=400)
    y[20:30] = np.nan
    return gj.regress(y, gj.regression.trend(np.arange(400.0)), "WN", rate=1.0)


KINDS = (
    "wavelet variance", "of several channels", "with gaps", "robust", "from a table", "fit", "fit with weights given",
    "fit with a value held", "fit at a boundary", "fits", "selection", "bootstrap", "joint fit", "joint fits",
    "each fit",
    "Allan deviation", "goodness of fit", "regression", "robust comparison", "records compared",
    "influence", "posterior",
)  # fmt: skip


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_result_comes_back_as_it_was(results, tmp_path, kind, suffix, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = results[kind].save(tmp_path / "new" / f"x{suffix}")
    assert path == tmp_path / "new" / f"x{suffix}"
    assert_same_result(load(path), results[kind])
    assert_same_result(type(results[kind]).load(path), results[kind])


def test_all_kinds_are_there(results):
    assert tuple(results) == KINDS


@pytest.mark.parametrize(
    ("kind", "figure"),
    [
        ("wavelet variance", "wavelet_variance_data"), ("fit", "fit_data"), ("fits", "fits_data"),
        ("selection", "selection_data"), ("bootstrap", "bootstrap_data"), ("joint fit", "joint_fit_data"),
        ("joint fits", "joint_fits_data"), ("Allan deviation", "allan_deviation_data"),
        ("regression", "regression_data"), ("robust comparison", "robust_comparison_data"),
        ("records compared", "record_comparison_data"), ("influence", "influence_data"),
        ("posterior", "posterior_data"),
    ],
)  # fmt: skip
def test_it_is_drawn_as_before(results, tmp_path, kind, figure):
    found = load(results[kind].save(tmp_path / "x.json"))
    data = getattr(gj.plotting, figure)
    shown = arrays_of(data(found))
    assert shown
    for a, b in zip(shown, arrays_of(data(results[kind])), strict=True):
        np.testing.assert_array_equal(a, b)


def test_what_follows_from_it_is_the_same(results, tmp_path, fit):
    found = load(fit.save(tmp_path / "fit.json"))
    np.testing.assert_array_equal(found.covariance, fit.covariance)
    assert repr(found.continuous()) == repr(fit.continuous())
    assert repr(found.datasheet()) == repr(fit.datasheet())
    again = gj.bootstrap(found, 20, key=jax.random.key(0))
    assert_same_result(again, results["bootstrap"])
    np.testing.assert_array_equal(again.covariance, results["bootstrap"].covariance)
    joint = load(results["joint fit"].save(tmp_path / "joint.npz"))
    np.testing.assert_array_equal(joint.weights_efficiency(), results["joint fit"].weights_efficiency())
    selection = load(results["selection"].save(tmp_path / "selection.npz"))
    assert selection.recommended.name == results["selection"].recommended.name
    assert selection["WN"].fit.objective == results["selection"]["WN"].fit.objective


def test_numbers_keep_all_their_bits(tmp_path):
    rng = np.random.default_rng(0)
    bits = rng.integers(0, 2**63, 300, dtype=np.int64).view(np.float64)
    low = np.concatenate([np.sort(bits[np.isfinite(bits)])[:50], [5e-324, 2.2250738585072014e-308, -0.0]])
    wv = WaveletVariance(2.0 ** np.arange(1, 54), np.ones(53), low, np.full(53, np.inf))
    for suffix in FORMATS:
        assert_same_result(load(wv.save(tmp_path / f"x{suffix}")), wv)


def test_equal_results_make_equal_files(fit, tmp_path):
    for suffix in (".npz", ".json"):
        a, b = (fit.save(tmp_path / f"{name}{suffix}").read_bytes() for name in "ab")
        assert a == b


def test_arrays_that_are_shared_are_written_once(results):
    arrays = to_state(results["selection"]).arrays
    assert len([name for name in arrays if name.endswith("scales")]) == 1


def test_a_file_of_the_first_format_is_read():
    """What this version wrote, later ones read: a class or a field has got another name if this fails."""
    found = load(WRITTEN_BY_FORMAT_1)
    assert found.model.labels == ("WN", "RW")
    assert found.wv.channels == ("gyro_x",)
    assert f"{found.objective:.6g}" == "0.395747"


def test_files_know_these_classes():
    own = [name for name in registered() if name.startswith("gmwm_jax.")]
    assert own == [
        f"gmwm_jax.{name}"
        for name in (
            "AbstractProcess", "AllanDeviation", "Bands", "Bootstrap", "BootstrapSource", "Candidate", "Channels",
            "Coefficients", "Composite", "Covariance", "CrossValidation", "Default", "Dwt", "EachBatch", "EachFit",
            "Fit", "Given",
            "GoodnessOfFit", "Influence", "Iterated", "JointFit", "LogDensity", "MeanOfRecords", "ModelScore",
            "Modwt", "NearStationarity", "OutlierRun", "Pairs", "ParameterSpread", "Posterior",
            "RecordComparison", "Regression", "Replicates",
            "Robust", "RobustComparison", "Selection", "StabilityDeviation", "TwoStep", "WaveletVariance",
            "WaveletVariances", "Within",
        )
    ]  # fmt: skip


# -- what cannot be saved ---------------------------------------------------------------------------------------------


class Loud(gj.WN):
    """A process from outside of the package."""

    kind = "LOUD"


class Quiet(gj.WN):
    """One with the name of another."""


@dataclass(frozen=True)
class Own(Default):
    """Weights of a user."""


@dataclass(frozen=True, repr=False)
class MyFit(Fit):
    """A class of a user."""


@pytest.mark.parametrize("process", [Loud, Quiet])
def test_a_process_of_a_user_is_refused(fit, tmp_path, process):
    own = replace(fit, model=gj.Composite([process(1.0)]))
    with pytest.raises(ValueError, match=f"A Fit cannot be saved: {process.kind} is a process of your own"):
        own.save(tmp_path / "x.npz")
    assert not list(tmp_path.iterdir())


def test_what_is_of_no_class_of_ours_is_refused(fit, tmp_path):
    for own, complaint in (
        (replace(fit, weights=Own()), "weights is a Own of .*, which no file holds"),
        (MyFit(**vars(replace(fit))), "it is a MyFit of .*, which no file holds"),
        (replace(fit, omega=fit.omega.astype(np.float32)), "omega is of dtype float32: files hold bool, int32"),
        (replace(fit, omega=fit.omega * np.nan), "omega must be finite, and is not"),
    ):
        with pytest.raises(ValueError, match=f"cannot be saved: {complaint}"):
            own.save(tmp_path / "x.json")


@pytest.mark.parametrize("name", ["x", "x.pkl", "x.csv"])
def test_another_ending_is_refused(fit, tmp_path, name):
    for act in (fit.save, load, Fit.load):
        with pytest.raises(ValueError, match=rf"Results are \.npz, \.json or \.nc files .*/{name}\.$"):
            act(tmp_path / name)


# -- what cannot be read ----------------------------------------------------------------------------------------------


def test_what_is_not_there(tmp_path):
    for suffix in FORMATS:
        with pytest.raises(FileNotFoundError, match=rf"There is no .*/x\{suffix}"):
            load(tmp_path / f"x{suffix}")


def test_another_class_is_wanted(fit, results, tmp_path):
    path = fit.save(tmp_path / "x.npz")
    for cls in (Selection, Bootstrap, JointFit, WaveletVariance):
        with pytest.raises(ValueError, match=rf"x\.npz holds a Fit, and a {cls.__name__} is wanted"):
            cls.load(path)


@pytest.mark.parametrize("suffix", [".npz", ".json"])
def test_every_damage_is_seen(fit, tmp_path, suffix):
    """One byte changed, or a file cut off: it is refused, or it is a byte that nothing depends on."""
    path = fit.save(tmp_path / f"x{suffix}")
    whole, rng = path.read_bytes(), np.random.default_rng(0)
    refused = 0
    for at in rng.integers(0, len(whole), 100):
        broken = bytearray(whole)
        broken[at] ^= 1 << rng.integers(0, 8)
        path.write_bytes(broken)
        try:
            assert_same_result(load(path), fit)
        except ValueError:
            refused += 1
    assert refused > 60
    for size in rng.integers(0, len(whole), 30):
        path.write_bytes(whole[:size])
        with pytest.raises(ValueError, match=rf"x\{suffix} cannot be read: it is corrupt, cut off"):
            load(path)


def change(tree, where, value):
    """A copy of a tree with another value at a place; None takes it away."""
    changed = copy.deepcopy(tree)
    *way, last = where.split(".")
    at = changed
    for step in way:
        at = at[int(step) if isinstance(at, list) else step]
    if value is None:
        del at[last]
    else:
        at[int(last) if isinstance(at, list) else last] = value
    return changed


@pytest.mark.parametrize(
    ("where", "value", "complaint"),
    [
        ("objective", None, r"it is a gmwm_jax.Fit, and lacks \['objective'\]"),
        ("more", 1, r"or has \['more'\] more"),
        ("class", "builtins.eval", "it is no object of a known class"),
        ("class", "gmwm_jax.Composite", "it is a gmwm_jax.Composite, and lacks"),
        ("class", ["gmwm_jax.Fit"], "it is no object of a known class"),
        ("level", "0.95", "level must be of type float, and is '0.95'"),
        ("level", True, "level must be of type float"),
        ("level", "inf", "level must be finite"),
        ("rate", "fast", "rate must be of type float"),
        ("status", "splendid", "status is one of converged, stalled"),
        ("status", ["converged"], "status is one of"),
        ("at_boundary", {"WN": "GONE"}, "at_boundary.WN is one of ESTIMATED"),
        ("at_boundary", [], "at_boundary must be a mapping"),
        ("weights", {"class": "gmwm_jax.Modwt"}, "weights must be a AbstractWeights, and is a Modwt"),
        ("weights", "default", "weights is no object of a known class"),
        ("weights", {"class": "gmwm_jax.TwoStep", "first": {"class": "os.system"}}, "weights.first is no object"),
        ("omega", {"array": "wv.scales"}, r"omega has the shape \(10,\)"),
        ("omega", {"array": "wv.secrets"}, "omega is no array of the file"),
        ("omega", {"array": ["wv.scales"]}, "omega is no array of the file"),
        ("omega", [[1.0]], "omega is no array of the file"),
        ("wv.channels", "x", "wv.channels must be a list"),
        ("wv.channels", [1], "wv.channels.0 must be of type str"),
        ("wv.num_samples", 3000.0, "wv.num_samples must be of type int"),
        (
            "wv.variance", {"array": "omega"},
            r"wv.variance has the shape \(10, 10\)|wv.ci_low has the shape \(10,\)|wv is no WaveletVariance",
        ),
        ("model.processes", [], "model is no Composite: A model needs at least one process"),
        ("model.processes.0.kind", "NOISE", "model.processes.0 is no AbstractProcess: Unknown process 'NOISE'"),
        ("model.processes.0.values.sigma2", -1.0, r"sigma2 must be one number in \[0, inf\)"),
        ("model.processes.0.values.sigma3", 1.0, "model.processes.0 is no AbstractProcess: .*sigma3"),
        ("model.processes.1.fixed", ["beta"], "RW holds beta at no value"),
    ],
)  # fmt: skip
def test_a_state_that_is_wrong_is_refused_where_it_is(fit, tmp_path, where, value, complaint):
    """Files with right checksums: somebody has made them."""
    state = to_state(fit)
    path = write_state(
        tmp_path / "x.npz", Content("gmwm_jax.Fit", State(change(state.tree, where, value), state.arrays))
    )
    with pytest.raises(ValueError, match=rf"x\.npz holds no gmwm_jax\.Fit: .*({complaint})"):
        load(path)


def test_arrays_that_are_wrong_are_refused(fit, tmp_path):
    state = to_state(fit)
    for name, array, complaint in (
        ("omega", np.full((10, 10), np.nan), "omega must be finite"),
        ("omega", np.ones((10, 10), bool), "omega has .* dtype bool"),
        ("omega", np.ones((10, 11)), r"omega has the shape \(10, 11\)"),
        ("omega", np.ones((3, 3)), "weights for 3 scales, and 10 scales"),
        ("wv.ci_low", np.ones(9), r"wv.ci_low has the shape \(9,\)"),
        ("wv.variance", -np.ones(10), "wv is no WaveletVariance: variance"),
    ):
        content = Content("gmwm_jax.Fit", State(state.tree, {**state.arrays, name: array}))
        for suffix in FORMATS:
            with pytest.raises(ValueError, match=complaint):
                load(write_state(tmp_path / f"x{suffix}", content))


def test_what_says_that_it_is_something_else(fit, tmp_path):
    state = to_state(fit)
    for kind, complaint in (
        ("gmwm_jax.Selection", "says that it holds a gmwm_jax.Selection, and holds a gmwm_jax.Fit"),
        ("gmwm_jax.Later", "holds a 'Later' of 'gmwm_jax', which is not known here"),
        ("nav_jax.Later", "which is not known here: import nav_jax, and read it with nav_jax.load"),
    ):
        with pytest.raises(ValueError, match=complaint):
            load(write_state(tmp_path / "x.json", Content(kind, state)))


def test_a_newer_format_is_told(fit, tmp_path, monkeypatch):
    monkeypatch.setattr(state_files, "FORMAT", 2)
    paths = [fit.save(tmp_path / f"x{suffix}") for suffix in FORMATS]
    monkeypatch.undo()
    for path in paths:
        with pytest.raises(ValueError, match=r"newer version \(format 2, known is 1\): update gmwm-jax"):
            load(path)


def with_array(text):
    return f'{{"format": 1, "kind": "x", "checksum": "", "state": {{}}, "arrays": {{"a": {text}}}}}'


@pytest.mark.parametrize(
    "text",
    [
        "", "[]", "{}", "null", '{"format": 1}', "[" * 100_000, '{"format": NaN}', '"\\ud800"', "\x00\xff",
        '{"format": "1", "kind": "gmwm_jax.Fit", "checksum": "", "state": {}}',
        '{"format": 1, "kind": "gmwm_jax.Fit", "checksum": "", "state": {}}',
        with_array('{"dtype": "O", "shape": [], "values": []}'),
        with_array('{"dtype": "float64", "shape": [1000000000000], "values": [1]}'),
        with_array('{"dtype": "float64", "shape": [1], "values": ["x"]}'),
        with_array('{"dtype": "int64", "shape": [1], "values": [1.5]}'),
        with_array('{"dtype": "int64", "values": [1]}'),
        with_array("1"),
    ],
)  # fmt: skip
def test_text_that_is_no_result(tmp_path, text):
    path = tmp_path / "x.json"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(
        ValueError, match=r"x\.json (cannot be read|was not written by save|is not what was written|was wri)"
    ):
        load(path)


def archive(path, members, compression=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", compression) as file:
        for name, content in members:
            file.writestr(name, content)
    return path


def npy(array, **options):
    file = io.BytesIO()
    np.save(file, array, **options)
    return file.getvalue()


def evil(*_):
    raise AssertionError("it was unpickled")


class Evil:
    def __reduce__(self):
        return evil, ()


HEADER = json.dumps({"format": 1, "kind": "gmwm_jax.Fit", "checksum": "", "state": {}})


@pytest.mark.parametrize(
    ("members", "complaint"),
    [
        ([], "no header.json"),
        ([("a.npy", npy(np.ones(3)))], "no header.json"),
        ([("header.json", HEADER), ("a.npy", npy(np.array([Evil()]), allow_pickle=True))], "dtype object"),
        ([("header.json", HEADER), ("a.npy", npy(np.ones(3, np.complex128)))], "dtype complex128"),
        ([("header.json", HEADER), ("a.npy", npy(np.zeros(3, "datetime64[s]")))], "dtype datetime64"),
        ([("header.json", HEADER), ("a.npy", npy(np.ones(3)).replace(b"(3,)", b"(9,)"))], r"shape \(9,\) in 24 bytes"),
        ([("header.json", HEADER), ("a.npy", npy(np.ones(3)).replace(b"(3,), } ", b"(f(),), }"))], "cannot be read"),
        ([("header.json", HEADER), ("a.npy", b"\x93NUMPY\x01\x00\xff\xff" + b" " * 70_000)], "cannot be read"),
        ([("header.json", HEADER), ("a.npy", b"nothing")], "cannot be read"),
        ([("header.json", HEADER), ("../a.txt", "x")], r"'\.\./a\.txt' is no array"),
        ([("header.json", HEADER)], "is not what was written"),
    ],
)  # fmt: skip
def test_archives_that_are_no_result(tmp_path, members, complaint):
    path = archive(tmp_path / "x.npz", members)
    with pytest.raises(ValueError, match=complaint):
        load(path)


def test_archives_that_would_be_large(tmp_path, monkeypatch):
    bomb = [("header.json", HEADER), ("a.npy", npy(np.zeros(10**6)))]
    with pytest.raises(ValueError, match=r"'header\.json' is compressed"):
        load(archive(tmp_path / "x.npz", bomb, zipfile.ZIP_DEFLATED))
    monkeypatch.setattr(state_files, "MAX_HEADER", 50)
    with pytest.raises(ValueError, match=r"its header has \d+ bytes, and at most 50 are read"):
        load(archive(tmp_path / "x.npz", bomb))
    monkeypatch.setattr(state_files, "MAX_JSON", 50)
    (tmp_path / "x.json").write_text(" " * 51)
    with pytest.raises(ValueError, match="it has 51 bytes, and at most 50 are read"):
        load(tmp_path / "x.json")


def test_a_state_that_is_nested_too_deeply(fit, tmp_path):
    state = to_state(fit)
    weights = {"class": "gmwm_jax.Default"}
    for _ in range(600):
        weights = {"class": "gmwm_jax.TwoStep", "first": weights}
    content = Content("gmwm_jax.Fit", State({**state.tree, "weights": weights}, state.arrays))
    with pytest.raises(ValueError, match=r"nested too deeply|cannot be read"):
        load(write_state(tmp_path / "x.json", content))


def test_zarr_does_not_unpickle(fit, tmp_path):
    path = fit.save(tmp_path / "x.zarr")
    for file in (path / "omega" / ".zarray", path / ".zmetadata"):
        file.write_text(file.read_text().replace('"filters": null', '"filters": [{"id": "pickle"}]'))
    with pytest.raises(ValueError, match=r"has the filter \{'id': 'pickle'\}"):
        load(path)


def test_estimators_and_weights_are_those_that_they_were(results, tmp_path):
    assert load(results["robust"].save(tmp_path / "a.json")).estimator == Robust(0.6)
    assert load(results["wavelet variance"].save(tmp_path / "a.json")).estimator == Modwt()
    weights = load(results["fit with weights given"].save(tmp_path / "a.json")).weights
    assert isinstance(weights, Given)
    assert read_state(tmp_path / "a.json").kind == "gmwm_jax.Fit"


@pytest.mark.slow
def test_a_fresh_process_knows_what_it_reads(tmp_path, fit):
    """Nobody has asked for the class of what is in the file by then."""
    path = fit.save(tmp_path / "fit.json")
    program = "import gmwm_jax as gj, jax; jax.config.update('jax_enable_x64', True); print(repr(gj.load({!r})))"
    seen = subprocess.run(
        [sys.executable, "-c", program.format(str(path))], capture_output=True, text=True, check=True, timeout=120
    )
    assert seen.stdout.rstrip("\n") == repr(fit)
