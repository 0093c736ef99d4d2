"""The room Navigation in a browser: the analysis at once, runs by a button, all of it for the inputs that are seen."""

import io
import re
import zipfile
from urllib.parse import urlencode

import jax
import numpy as np
from nav.small_drive import write_drive
from web.pages import curves, drawn, enter

import nav_jax as nj
from nav_jax.app.web.study import config_of_text

INPUTS = {
    "room": "nav", "samples": 2000, "nav_truth": "text", "nav_accel": "WN(sigma2=1e-4)", "nav_gyro": "WN(sigma2=1e-6)",
    "nav_rate": "20", "nav_motion": "circle", "nav_circle_duration": "60", "nav_aiding": "gnss_position",
    "nav_gnss_position_outages": "[[2, 4]]", "nav_run_every": "1", "nav_own_accel": "WN(sigma2=1e-6)",
    "nav_own_gyro": "WN(sigma2=1e-8)", "nav_page": 0, "nav_structures": "", "nav_run_num_runs": "8",
}  # fmt: skip


def opened(open_page, **inputs):
    page = open_page(f"?{urlencode(INPUTS | inputs)}")
    page.locator("#nav_analysed table").wait_for()
    return page


def files_of(page, button):
    with page.expect_download() as waited:
        page.locator(f"#{button}").click()
    return zipfile.ZipFile(io.BytesIO(waited.value.path().read_bytes()))


def test_the_analysis_comes_at_once_and_runs_by_a_button(open_page):
    page = opened(open_page)
    table = page.locator("#nav_analysed table")
    archive = files_of(page, "nav_archive")
    assert {"analysis.csv", "analysis.pdf", "navigation.py"} < set(archive.namelist())
    assert page.locator("#nav_runs_table table").count() == 0
    page.locator("#nav_run").click()
    page.locator("#nav_runs_table", has_text="8 common runs;").wait_for()
    drawn(page, "nav_runs_figure")
    config = config_of_text(archive.read("comparison.toml").decode())
    analysis = nj.analyse(config.scenario, config.truth, config.filters)
    k = analysis["own"].epoch()
    assert f"{analysis['own'].rms('position')[k]:.5g}" in table.inner_text()
    ranked = nj.compare(config.scenario, config.truth, config.filters, num_runs=8, key=jax.random.key(0)).table()
    said = page.locator("#nav_runs_table").inner_text()
    assert all(f"{one.mean_position:.5g}" in said and one.verdict in said for one in ranked)
    assert {"own", "own, as claimed", "outage"} <= set(curves(page, "nav_analysis"))
    # nothing stale beside new inputs
    enter(page, "nav_circle_radius", "30")
    page.locator("#nav_runs_table table").wait_for(state="detached")
    page.locator("#nav_analysed table").wait_for()
    assert "nav_circle_radius=30" in page.url
    # what is wrong is said, and nothing is shown
    enter(page, "nav_circle_radius", "5 kg")
    page.locator("#nav_status .gmwm-error", has_text="[trajectory], radius: '5 kg'").wait_for()
    assert page.locator("#nav_analysed table").count() == 0


def test_what_the_unit_leaves_is_switched_on_with_a_filter_beside_that_does_not_know(open_page):
    page = opened(open_page)
    page.locator("summary", has_text="Truth: scale factor").click()
    enter(page, "nav_scale_factor_gyro_sd", "1 %")
    page.locator("#nav_analysed", has_text="uncalibrated").wait_for()
    assert "nav_scale_factor_gyro_sd=1+%25" in page.url
    page.locator("#nav_uncalibrated").click()
    page.locator("#nav_analysed", has_not_text="uncalibrated").locator("table").wait_for()


def test_runs_that_are_cancelled_are_kept_and_said_to_be_fewer(open_page):
    page = opened(open_page, nav_run_num_runs=2000)
    page.locator("#nav_run").click()
    page.locator("#job_text", has_text=re.compile(r"\d+ of \d+, about \d+ s left")).wait_for()
    page.locator("#cancel").click()
    page.locator("#nav_runs_table", has_text=re.compile(r"\d+ common runs of 2000 that were asked for")).wait_for()
    assert page.locator("#job").is_hidden()


def test_the_budget_of_a_filter(open_page):
    page = opened(open_page)
    page.locator("#nav_of").select_option("own")
    page.locator("#nav_budget").click()
    page.locator("#nav_budget_table", has_text="Error budget of own at").wait_for()
    drawn(page, "nav_budget_figure")


def test_a_filter_that_is_chosen_stays_chosen(open_page):
    page = opened(open_page)
    shown = page.evaluate(
        """async () => {
            const select = document.getElementById("nav_of"), seen = [];
            const choose = name => { select.value = name; select.dispatchEvent(new Event("change", {bubbles: true})); };
            const later = ms => new Promise(done => setTimeout(done, ms));
            for (let k = 0; k < 10; k++) { choose("own"); await later(5); choose("right"); await later(5); }
            choose("own");
            for (let k = 0; k < 300; k++) { await later(5); seen.push(select.value); }
            return seen;
        }"""
    )
    assert set(shown) == {"own"}


def test_every_input_has_a_label_and_a_phone_shows_all(open_page):
    page = open_page(f"?{urlencode(INPUTS)}", size=(390, 844), scheme="dark")
    drawn(page, "nav_analysis")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    without = page.evaluate(
        """() => [...document.querySelectorAll('[data-value=nav] input, [data-value=nav] select')]
            .filter(e => !e.labels.length && !e.ariaLabel && e.type !== 'checkbox').map(e => e.id)"""
    )
    assert not without
    assert "RMS position error" in page.locator("#nav_analysis").get_attribute("aria-label")


def test_the_last_steps_of_the_tutorial(open_page):
    page = open_page("?room=tutorial")
    recap = page.locator("#step_10 table")
    recap.wait_for()
    assert "0.107" in recap.inner_text()
    wrong = page.locator("#step_11")
    wrong.locator("table").wait_for()
    assert "Printed: [66 %, 74 %] about 70 %" in wrong.inner_text()
    page.locator("#step_12", has_text="a constant bias").wait_for()
    links = page.get_by_role("link", name="Do this step")
    assert links.count() == 12
    assert "room=nav" in links.nth(10).get_attribute("href")


def test_a_trajectory_that_is_sent(open_page, tmp_path):
    page = open_page(f"?{urlencode(INPUTS | {'nav_motion': 'file'})}")
    page.locator("#nav_status .gmwm-error", has_text="send its file").wait_for()
    circle = nj.motions.circle(duration=60.0, rate=20.0)
    page.locator("#nav_sent").set_input_files(nj.trajectory.save_trajectory(circle, tmp_path / "mine.csv"))
    table = page.locator("#nav_analysed table")
    table.wait_for()
    archive = files_of(page, "nav_archive")
    text = archive.read("comparison.toml").decode()
    (name,) = (n for n in archive.namelist() if n.startswith("trajectory-"))
    archive.extract(name, tmp_path)
    config = config_of_text(text, tmp_path)
    np.testing.assert_allclose(config.scenario.reference.position, circle.position, atol=1e-12)
    own = nj.analyse(config.scenario, config.truth, config.filters)["own"]
    assert f"{own.rms('position')[own.epoch()]:.5g}" in table.inner_text()
    page.locator("#nav_sent").set_input_files({"name": "no.csv", "mimeType": "text/csv", "buffer": b"1,2\n"})
    page.locator("#nav_status .gmwm-error", has_text="no.csv").wait_for()


def test_a_recorded_drive(open_page, tmp_path):
    page = opened(open_page)
    page.locator("#nav_drive").set_input_files(write_drive(tmp_path))
    page.locator("#nav_drive_progress", has_text="Upload complete").wait_for()
    page.locator("#nav_navigate").click()
    page.locator("#nav_drive_text", has_text="white: ").wait_for()
    drawn(page, "nav_drive_figure")
    assert "refused" not in page.locator("#nav_drive_text").inner_text()
    # by a filter of that name, with a gate; nothing stale beside other inputs
    enter(page, "nav_drive_gate", 0.999)
    page.locator("#nav_drive_text pre").wait_for(state="detached")
    enter(page, "nav_drive_vibration", 0.1)
    enter(page, "nav_drive_filter", "white")
    page.locator("#nav_navigate").click()
    page.locator("#nav_drive_text", has_text="refused").wait_for()
    assert {"nav_drive_gate=0.999", "nav_drive_filter=white"} <= set(page.url.partition("?")[2].split("&"))
    enter(page, "nav_drive_filter", "nobody")
    page.locator("#nav_navigate").click()
    page.locator("#nav_drive_status .gmwm-error", has_text="There is no filter 'nobody'; there are white.").wait_for()
    enter(page, "nav_drive_gate", 0.1)
    page.locator("#nav_navigate").click()
    page.locator("#nav_status .gmwm-error", has_text="Gate: must be greater than or equal to 0.5").wait_for()


def test_outages_of_a_recorded_drive(open_page, tmp_path):
    page = opened(open_page)
    page.locator("#nav_outages").click()
    page.get_by_text("Send the files of a drive first.").wait_for()
    page.locator("#nav_drive").set_input_files(write_drive(tmp_path))
    page.locator("#nav_drive_progress", has_text="Upload complete").wait_for()
    # of the defaults of the command there is no place in four seconds
    page.locator("#nav_outages").click()
    page.locator("#nav_outages_status .gmwm-error", has_text="no place for an outage of 15 s").wait_for()
    enter(page, "nav_outage_last", 0.5)
    enter(page, "nav_outage_every", 1)
    page.locator("#nav_outages_status .gmwm-error").wait_for(state="detached")
    page.locator("#nav_outages").click()
    page.locator("#nav_outages_text", has_text="white: 4 outages of gnss_position").wait_for()
    drawn(page, "nav_outages_figure")
    assert {"claimed (rms)", "predicted - measured"} <= set(curves(page, "nav_outages_figure"))
    assert "nav_outage_last=0.5" in page.url
    enter(page, "nav_outage_runs", 1)
    page.locator("#nav_outages_text pre").wait_for(state="detached")
    page.locator("#nav_outages").click()
    page.locator("#nav_outages_text", has_text="white: 2 outages of gnss_position").wait_for()
    # nothing stale beside another length
    enter(page, "nav_outage_last", 0.25)
    page.locator("#nav_outages_text pre").wait_for(state="detached")
