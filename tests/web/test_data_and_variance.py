"""The rooms Data and Variance in a browser: what is drawn is what the library computes."""

import jax
import numpy as np
import pytest
from web.pages import curves, drawn, enter, go_to, until

import gmwm_jax as gj
from gmwm_jax.app.web import tables

CHANNELS = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
NUM_FRAMES = "() => Object.keys(variances._fullLayout).filter(key => key.startsWith('xaxis')).length"


@pytest.fixture(scope="module")
def record():
    """Two channels, 4000 samples at 100 Hz."""
    return gj.datasets.simulated("mti-g", 4000, key=jax.random.key(3), channels=["gyro_x", "accel_x"])


def shown_variance(page):
    drawn(page, "variances")
    return curves(page, "variances")["wavelet variance"]


def test_it_starts_offline_with_names_for_everything(open_page):
    page = open_page()
    drawn(page, "series")
    drawn(page, "steps")
    assert page.title().startswith("gmwm_jax")
    assert "simulated mti-g: 100000 samples at 100 Hz" in page.locator("#about").inner_text()
    assert "time" in page.locator("#series").get_attribute("aria-label")
    nameless = page.evaluate(
        """() => [...document.querySelectorAll('input, select, button, textarea')].filter(e => e.type !== 'hidden'
            && e.offsetParent && !(e.labels && [...e.labels].some(l => l.innerText.trim()))
            && !e.getAttribute('aria-label') && !e.innerText.trim() && !e.title).map(e => e.outerHTML)"""
    )
    assert not nameless
    reached = []
    for _ in range(40):  # by keyboard alone
        page.keyboard.press("Tab")
        reached.append(page.evaluate("() => document.activeElement.dataset.value || document.activeElement.id"))
    assert {"data", "channel", "simulated", "sensor", "samples"} <= set(reached)
    page.locator('.navbar a[data-value="data"]').focus()
    page.keyboard.press("ArrowRight")
    drawn(page, "variances")


def test_the_variance_is_that_of_the_library(open_page):
    page = open_page("?room=variance&samples=5000&seed=4&sensor=navchip")
    x, y = shown_variance(page)
    wv = gj.wavelet_variance(gj.datasets.simulated("navchip", 5000, key=jax.random.key(4)))
    assert wv.channels[0] in page.locator("#variances").inner_text()
    np.testing.assert_allclose(x, wv.times, rtol=1e-12)
    # names are those of the last of the channels
    np.testing.assert_allclose(y, wv[-1].variance if len(CHANNELS) > 1 else wv[0].variance, rtol=1e-12)
    before = drawn(page, "variances")
    page.locator("#every").click()
    until(lambda: page.evaluate(NUM_FRAMES) == 1)
    after = drawn(page, "variances", after=before)
    np.testing.assert_allclose(curves(page, "variances")["wavelet variance"][1], wv[0].variance, rtol=1e-12)
    wanted = tables.readings(wv).rows[0][2]
    assert f"{wanted:.5g}" in page.locator("#read_off").inner_text()
    assert f"{wv[0].variance[3]:.5g}" in page.locator("#scales").inner_text()
    page.locator("#allan").click()
    until(lambda: "Allan variance" in curves(page, "variances"))
    after = drawn(page, "variances", after=after)
    x, y = curves(page, "variances")["Allan variance"]
    np.testing.assert_allclose(x, wv.times / 2, rtol=1e-12)
    np.testing.assert_allclose(y, 2 * wv[0].variance, rtol=1e-12)
    enter(page, "datasheet", "N=0.15 deg/sqrt(h)")
    until(lambda: "datasheet" in curves(page, "variances"))
    promised, _ = gj.from_datasheet({"N": "0.15 deg/sqrt(h)"}, wv.rate)
    shown = curves(page, "variances")["datasheet"][1]
    np.testing.assert_allclose(shown, 2 * np.asarray(promised.wavelet_variance(wv.scales)), rtol=1e-12)
    enter(page, "datasheet", "N=fast")
    page.locator("#variance_status .gmwm-error").wait_for()


def test_robust_beside_classic(open_page):
    page = open_page("?room=variance&samples=5000&every=0&compare=1")
    drawn(page, "variances")
    rec = gj.datasets.simulated("mti-g", 5000)["gyro_x"]
    names = curves(page, "variances")
    assert len(names) == 2
    robust = gj.wavelet_variance(rec, efficiency=0.6)
    np.testing.assert_allclose(
        next(y for name, (_, y) in names.items() if "obust" in name), robust.variance, rtol=1e-12
    )


def written(folder, kind, record):
    """A file of that kind with the record, and the inputs that it needs."""
    data, path = np.asarray(record.data), folder / f"imu.{kind.partition('-')[2] or kind}"
    if kind == "npy":
        np.save(path, data)
        return path, {"rate": 100, "units": "rad/s"}
    if kind == "npz":
        return gj.save_recording(record, path), {}
    if kind == "parquet":
        import pandas

        pandas.DataFrame(data, columns=["gyro_x", "accel_x"]).to_parquet(path)
        return path, {"rate": 100, "units": "gyro=rad/s, accel=m/s^2"}
    options = {"delimiter": ";" if kind == "semicolon-csv" else ",", "fmt": "%.17g", "comments": ""}
    if kind == "semicolon-csv":
        np.savetxt(path, np.column_stack([np.arange(len(data)) / 100, data]), header="time;gyro_x;accel_x", **options)
        return path, {"time": "time", "units": "gyro=rad/s, accel=m/s^2"}
    np.savetxt(path, data[:, :1], **options)
    return path, {"rate": 100, "units": "rad/s"}


def test_files_of_every_kind_give_the_curve_of_the_library(open_page, record, tmp_path):
    page = open_page("?source=file")
    wanted = gj.wavelet_variance(record["gyro_x"]).variance
    for kind in ("npz", "npy", "csv", "semicolon-csv", "parquet"):
        path, inputs = written(tmp_path, kind, record)
        for name in ("rate", "units", "time"):
            enter(page, name, inputs.get(name, ""))
        page.locator("#upload").set_input_files(path)
        page.locator("#facts", has_text=path.name).wait_for()
        go_to(page, "variance")
        if page.locator("#every").is_checked():
            page.locator("#every").click()
        drawn(page, "variances")
        page.wait_for_timeout(200)
        np.testing.assert_allclose(curves(page, "variances")["wavelet variance"][1], wanted, rtol=1e-9, err_msg=kind)
        go_to(page, "data")


def test_bad_files_get_a_sentence_and_the_page_lives(open_page, tmp_path):
    page = open_page("?source=file&rate=100&units=rad/s")
    files = {
        "text.csv": "nothing\nbut\nwords\n",
        "wide.csv": ",".join(["1"] * 3000) + "\n",
        "objects.npy": None,
        "pickle.csv": b"\x80\x04\x95",
        "lie.npy": b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"
        + b" " * 45
        + b"\n",
        "empty.csv": "",
        "nan.csv": "1\n2\nnan\n3\n" * 5,
        "x.unknown": "1\n2\n",
        "<b>bold</b>.csv": "a,b\n1,x\n",
    }
    for name, content in files.items():
        if content is None:
            np.save(tmp_path / name, np.array([{}, {}]), allow_pickle=True)
            content = (tmp_path / name).read_bytes()
        body = content if isinstance(content, bytes) else content.encode()
        page.locator("#upload").set_input_files({"name": name, "mimeType": "text/plain", "buffer": body})
        sentence = page.locator("#data_status .gmwm-error", has_text=name)
        sentence.wait_for()
        assert len(sentence.inner_text()) > len(name) + 10
        assert "/tmp" not in sentence.inner_text()
        assert "Internal" not in sentence.inner_text()
    page.locator("#upload").set_input_files({"name": "big.csv", "mimeType": "text/csv", "buffer": b"1\n" * 1_100_000})
    page.locator("#too_large", has_text="2 MB").wait_for()
    page.locator('#source a[data-value="simulated"]').click()
    drawn(page, "series")


def test_outliers_are_masked_when_asked(open_page, record, tmp_path):
    dirty = np.array(record.data)
    dirty[::97] += 0.5
    path = tmp_path / "dirty.npy"
    np.save(path, dirty[:, 0])
    page = open_page("?source=file&rate=100&units=rad/s&outliers=mask")
    page.locator("#upload").set_input_files(path)
    page.locator("#facts", has_text="missing").wait_for()
    masked = gj.recordings.mask_outliers(gj.Recording.from_array(dirty[:, 0], rate=100.0, units="rad/s"))
    go_to(page, "variance")
    _, y = shown_variance(page)
    np.testing.assert_allclose(y, gj.wavelet_variance(masked.recording).variance, rtol=1e-9)


def test_a_link_brings_the_inputs_back_and_pages_are_apart(open_page):
    page, other = open_page("?samples=5000"), open_page("?samples=6000&sensor=ln200")
    enter(page, "seed", 7)
    page.locator("#facts").wait_for()
    go_to(page, "variance")
    page.locator("#deviation").click()
    drawn(page, "variances")
    page.wait_for_timeout(300)
    query = page.url.partition("?")[2]
    assert set(query.split("&")) >= {"samples=5000", "seed=7", "room=variance", "deviation=1"}
    drawn(other, "series")
    assert "simulated ln200: 6000 samples" in other.locator("#about").inner_text()
    page.reload()
    drawn(page, "variances")
    assert page.locator("#deviation").is_checked()
    assert "5000 samples" in page.locator("#about").inner_text()


def test_wrong_inputs_get_their_label_and_nothing_stale_stays(open_page):
    page = open_page("?samples=5000")
    drawn(page, "series")
    enter(page, "samples", 10)
    page.locator("#data_status .gmwm-error", has_text="Samples").wait_for()
    page.wait_for_timeout(200)
    assert page.locator("#series").get_attribute("data-drawn") is None
    enter(page, "samples", 6000)
    drawn(page, "series")


@pytest.mark.parametrize(("size", "scheme"), [((1280, 900), "light"), ((390, 844), "dark")])
def test_no_room_is_wider_than_the_page(open_page, size, scheme):
    page = open_page("?room=variance&samples=5000&slopes=1", size=size, scheme=scheme)
    drawn(page, "variances")
    assert page.evaluate("() => document.documentElement.scrollWidth") <= size[0]
    assert page.evaluate("() => document.documentElement.dataset.bsTheme") == scheme
    assert page.evaluate(NUM_FRAMES) == 6
    at = "() => Object.values(variances._fullLayout).filter(v => v && v._id && v._id[0] === 'x').map(v => v.domain[0])"
    assert len(set(page.evaluate(at))) == (1 if size[0] < 560 else 3)  # one below the other on a phone
    ends = """() => [variances.querySelector('.legend').getBoundingClientRect().top, Math.max(
        ...[...variances.querySelectorAll('[class*=xtitle], .x6title')].map(e => e.getBoundingClientRect().bottom))]"""
    until(lambda: np.subtract(*page.evaluate(ends)) > 0)  # the legend lies below the titles of the axes
    page.set_viewport_size({"width": size[0] - 70, "height": size[1]})  # with more lines
    until(lambda: np.subtract(*page.evaluate(ends)) > 0)


def test_public_recordings_are_opened_by_name(open_page, record, tmp_path, monkeypatch):
    name = gj.datasets.names()[0]
    path = gj.save_recording(record, tmp_path / "public.npz")
    monkeypatch.setattr(gj.datasets, "fetch", {name: path}.__getitem__)
    page = open_page(f"?source=public&dataset={name}")
    page.locator("#about", has_text=f"{name}: 4000 samples at 100 Hz").wait_for()
    drawn(page, "series")

    def without_network(_):
        raise OSError("the file could not be fetched; without a network, put it there by hand")

    monkeypatch.setattr(gj.datasets, "fetch", without_network)
    page.locator("#dataset").select_option(gj.datasets.names()[1])
    page.locator("#data_status .gmwm-error", has_text="by hand").wait_for()


def test_gaps_are_an_error_pairs_or_the_longest_run(open_page, tmp_path):
    """Three samples are missing from 4000."""
    time, values = np.arange(4000) / 100, np.random.default_rng(1).normal(size=4000)
    there = ~np.isin(np.arange(4000), (1000, 1001, 3000))
    path = tmp_path / "gaps.csv"
    np.savetxt(path, np.column_stack([time, values])[there], header="time,gyro_x", comments="", delimiter=",")
    page = open_page("?source=file&units=rad/s&time=time")
    page.locator("#upload").set_input_files(path)
    page.locator("#data_status .gmwm-error", has_text="gaps.csv").wait_for()
    for gaps, samples in (("nan", 4000), ("longest", 1998)):
        page.locator("#gaps").select_option(gaps)
        page.locator("#about", has_text=f"{samples} samples").wait_for()
        go_to(page, "variance")
        rec = gj.read_recording(path, units="rad/s", time="time", gaps=gaps)
        wanted = gj.wavelet_variance(rec).variance
        until(lambda wanted=wanted: len(shown_variance(page)[1]) == len(wanted))
        np.testing.assert_allclose(shown_variance(page)[1], wanted, rtol=1e-9)
        go_to(page, "data")
